"""Links that bend far: positive kinetic energy, the energy that a swing keeps, the second order of small bending; and, of one link in a
plane or in both that twists, rigid segments with finite rotations that share no code with it.

Segments e_k of a chain, cut at N springs, half a segment at both ends; a mass beside the tip's axis is one more vector on the last. With
int r'.r' dm = sum_jk a_jk e_j'.e_k' and polar inertias J_k, virtual work on angular velocities w_k gives

    sum_j e_k x a_kj (w_j' x e_j + w_j x (w_j x e_j)) + J_k ((w_k'.e_k) e_k + (w_k.e_k) w_k x e_k) = springs,

each spring with the rotation vector between its neighbours, V = 1/2 theta.K theta. The error falls with N squared.
Source: Wittbrodt, Adamiec-Wojcik, Wojciech, Dynamics of Flexible Multibody Systems (2006); rotation vectors: Simo, Vu-Quoc (1988).
"""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.mechanics import bending_shapes
from flexlin.scene import builtin_scenes
from tests.closed_arm import control_loop
from tests.thinned import thin

from .jury import skew
from .scenes import LINK, arm_of, plain_scene, scene_of, swinging
from .test_jury import random_scene

STIFFENED = {"geometric_stiffening": {}}
THIN = {"length": 1.0, "mass_per_length": 0.162, "bending_stiffness": 1.4}


def light_arm(seed, **besides):
    """A thin link without a hub, on any axis in space or in the plane, that carries another; sections up to a fifth as high as long.

    From 12 on, odd ones are coupled by twist without being shortened.
    """
    rng = np.random.default_rng(seed)
    space, n, height = bool(seed % 2), int(rng.integers(1, 7)), rng.choice([0.01, 0.2])
    about_y, about_z = (height * rng.uniform(0.3, 1.0, 2)) ** 2
    modes = {"y": n, "z": int(rng.integers(1, 4)), "torsion": int(rng.integers(0, 4))} if space else n
    more = {"bending_stiffness": [1.4, 2.3], "torsional_stiffness": 1.0, "polar_inertia": 0.162 * (about_y + about_z)}
    axis = [[0, 0, 1], [1, 0, 0], rng.normal(size=3).tolist()][rng.integers(3)]
    effects = {**STIFFENED, "payload": {"mass": float(0.16 * rng.uniform(0, 1))}}
    if rng.random() < 0.7:
        effects["rotary_inertia"] = {"radius_of_gyration": [float(about_z**0.5), 0.0]}
    if space and (rng.random() < 0.7 or seed > 12):
        effects["bending_torsion_coupling"] = {}
    if space and seed > 12:
        modes["torsion"] = max(modes["torsion"], 1)
        del effects["geometric_stiffening"]
    first = {**THIN, "modes": modes, **({**more, "axis": axis} if space else {})}
    return arm_of(first, {**THIN, "modes": 2}, effects=effects | besides), rng


@pytest.mark.slow
@pytest.mark.parametrize("soft", [False, True])
@pytest.mark.parametrize("seed", thin([13, *range(12), *range(15, 25, 2)], quick=4))
def test_the_mass_matrix_is_positive_definite_however_far_a_link_bends(seed, soft):
    """Random light links in the plane and in space, 1 to 6 modes, no hub, tips bent by 2 to 30 % of the length; on soft bearings that
    tilt by up to 0.1 rad, with motors that hold the inertia of their rotors and hardly more.
    """
    rotors = {"rotor_spin": {"inertia": 1e-5, "gear_ratio": 60.0 * (-1) ** seed}}
    rotors |= {"bearing_compliance": {"stiffness": 80.0}}
    motors = {"joint_flexibility": {"stiffness": 50.0, "motor_inertia": 1.1e-5 * 60.0**2}}
    arm, rng = light_arm(seed, **(rotors | motors if soft else {}))
    kinds = np.array([one.kind for one in arm.coordinates])
    size = np.array([{"joint": 3.0, "motor": 3.0, "bearing": 0.1}.get(kind, 0.0) for kind in kinds])
    for _ in range(10):
        w = np.where(kinds == "elastic", rng.normal(size=arm.n), 0.0)
        w *= rng.uniform(0.02, 0.3) / 2 / np.abs(w).sum()
        M = arm.functions["M"](w + size * rng.uniform(-1, 1, arm.n), []).full()
        scale = 1 / np.sqrt(np.diag(M))
        assert np.linalg.eigvalsh(M * np.outer(scale, scale))[0] > 1e-9
        np.testing.assert_allclose(M, M.T, atol=1e-14 * np.abs(M).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 5, 13, 15, 103])
def test_light_links_swing_to_the_end_and_keep_their_energy(seed):
    """The same links, bent in all their shapes and let go without damping; the last took steps so short that they lost its motion."""
    arm, rng = light_arm(seed)
    w = np.r_[0.0, 0.0, rng.normal(size=arm.n - 2)]
    w *= rng.uniform(0.02, 0.3) / 2 / np.abs(w).sum()
    lin = fl.linearize(arm, scene_of(THIN, THIN).motion)
    run = fl.simulate(lin, 0.03, initial=np.r_[w, 0 * w], tol=1e-7, points_per_period=256)
    assert np.abs(run.nonlinear[:, 2 : arm.n]).max() > 0.5 * np.abs(w).max()
    assert max(run.energy_error / 1e-8, run.error / 1e-7) < 1


@pytest.mark.slow
def test_a_payload_that_may_vanish_and_a_link_that_bends_upward_alone():
    """Free numbers give what written ones do, also a payload of no mass whose centre lies beyond the tip."""
    for mass in (0.0, 0.2):
        links = {**THIN, "modes": {"z": 2}, "bending_stiffness": [1.4, 2.3]}, {**THIN, "modes": 2}
        effects = {**STIFFENED, "gravity": {}, "payload": {"mass": 0.2, "offset": 0.1, "inertia": 1e-3}}
        scene = scene_of(*links, effects=effects)
        free = fl.build_manipulator(scene, ["effects.payload.mass"])
        written = arm_of(*links, effects={**effects, "payload": {**effects["payload"], "mass": mass}})
        state = np.random.default_rng(0).normal(size=(2, free.n)) * np.r_[1, 1, np.full(free.n - 2, 0.05)]
        for name, at in (("M", state[:1]), ("energy", state)):
            one, other = free.functions[name](*at, [mass]).full(), written.functions[name](*at, []).full()
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-13)


OPEN = [name for name in builtin_scenes() if "geometric_stiffening" in fl.load_scene(name).effects.on()]
TREES = (0, 2, 3, 6, 7, 19, 36, 42, 45, 50, 41, 65, 75, 123)
"""Random scenes with the effect: tapered links, shear, and sections with inertia are among them; the last four twist without it."""


@pytest.mark.slow
@pytest.mark.parametrize("case", thin([*OPEN, *TREES], quick=4))
def test_to_first_order_the_curve_is_the_energy_of_second_order(case):
    """Residual and slopes of both forms of the equations agree on a rigid motion: they share neither integrals nor kinematics."""
    scene = fl.load_scene(case) if isinstance(case, str) else random_scene(case)
    arm = fl.build_manipulator(scene)
    assert arm is not arm.near
    lin, rng = fl.linearize(arm, scene.motion), np.random.default_rng(0)
    state = [part[0] for part in lin.about.positions(rng.uniform(0, lin.period, 1), *np.zeros((3, 1, lin.n)))]
    found = []
    for form in (arm, arm.near):
        by, phase = (form.s, form.s_dot, form.s_ddot), ca.SX.sym("phase") if form.phase is None else form.phase
        outputs = [*(ca.jacobian(form.residual, part) for part in by), form.residual]
        slopes = ca.Function("slopes", [*by, form.parameters.symbols, phase], outputs)
        found.append([part.full() for part in slopes(*state, form.parameters.values, 0.3)])
    for curve, second in zip(*found, strict=True):
        np.testing.assert_allclose(curve, second, atol=1e-12 + 1e-8 * np.abs(second).max())


@pytest.mark.slow
def test_a_strip_that_bends_is_judged_alike_with_any_number_of_modes():
    """A strip of 1 m without a hub, 30 x 2 mm of aluminium: with 2 and 3 modes it used to end in a mass matrix without meaning."""
    effects = {**STIFFENED, "payload": {"mass": 0.1}, "modal_damping": {"ratio": 0.01}}
    tables = {"effects": effects, "control": {"feedback": {"kind": "pd", "kp": [20.0], "kd": [3.0]}}}
    motion, errors = swinging({"amplitude": 0.3}, frequency=0.5), []
    for modes in (1, 2, 3, 4):
        run = fl.simulate(control_loop(plain_scene([{**THIN, "modes": modes}], motion, **tables)), 1.0, tol=1e-6)
        assert "the linear model holds here" in run.status
        errors.append(run.tip_error)
    np.testing.assert_allclose(errors[1:], errors[-1], rtol=0.02)


def test_scenes_without_the_effect_pay_nothing():
    arm = arm_of({**LINK, "modes": 2}, effects={"payload": {"mass": 0.1}})
    assert arm.near is arm


EI_Y, EI_Z, GJ, MASS, POLAR = 2.0, 1.4, 0.8, 0.162, 4e-5
PAYLOAD, BESIDE = 0.08, np.array([0.0, 0.04, 0.02])
SPATIAL = {"length": 1.0, "mass_per_length": MASS, "bending_stiffness": [EI_Y, EI_Z]}
SPATIAL |= {"torsional_stiffness": GJ, "polar_inertia": POLAR, "modes": {"y": 6, "z": 6, "torsion": 2}}
PLANAR = {**THIN, "modes": 4}
FIRST = bending_shapes(1)


def cross(v, w):
    """v x w of vectors (..., 3): NumPy's takes longer than all the rest here."""
    return v[..., [1, 2, 0]] * w[..., [2, 0, 1]] - v[..., [2, 0, 1]] * w[..., [1, 2, 0]]


def segment_form(length, mass, payload):
    """a (n, n) with T = 1/2 sum a_ij e_i'.e_j' of rigid segments: the lever l_i times (m_j / 2 + all beyond j) l_j."""
    beyond = np.append(np.cumsum(mass[::-1])[::-1][1:], 0.0) + payload
    a = np.triu(np.outer(length, length * (mass / 2 + beyond)), 1)
    return a + a.T + np.diag(length**2 * (mass / 3 + beyond))


def swing_segments(across, up, count, t, beside):
    """The tip (N, 3) of segments that hang on a hinge about z, let go from the first mode's slopes in both planes."""
    h, E = 1.0 / count, np.eye(3)
    length = np.r_[h / 2, np.full(count - 1, h), h / 2]
    a, bodies = segment_form(length, MASS * length, PAYLOAD), count + 1
    a = np.block([[a, PAYLOAD * length[:, None]], [PAYLOAD * length, PAYLOAD]])
    on = np.append(np.arange(bodies), bodies - 1)  # the body of each vector

    def sum_up(parts, axis=0):
        return np.add.reduceat(parts, range(bodies), axis)  # the last two are of one body

    springs = np.diag([GJ, EI_Y, EI_Z]) / h
    slope = FIRST.values(np.linspace(0, 1, bodies), 1)[0] / FIRST.values(np.ones(1))[0, 0]
    # Rz(v') Ry(-w') Rx(-int w' v''): no twist at the start
    turned = [slope * across, -slope * up, -(slope**2) * across * up / 2]
    start = Rotation.from_euler("ZYX", np.stack(turned, axis=1)).as_matrix()
    free = np.arange(3 * bodies) > 1  # the first segment turns about z alone

    def rates(_, x):
        R, w = x[: 9 * bodies].reshape(-1, 3, 3), x[9 * bodies :].reshape(-1, 3)
        e = np.concatenate([R[:, :, 0], (R[-1] @ beside)[None]])
        of, spin = w[on], np.sum(w * R[:, :, 0], axis=1)
        blocks = a[:, :, None, None] * ((e @ e.T)[:, :, None, None] * E - e[None, :, :, None] * e[:, None, None, :])
        M = sum_up(sum_up(blocks), 1).transpose(0, 2, 1, 3)
        M[range(bodies), :, range(bodies), :] += POLAR * length[:, None, None] * R[:, :, 0, None] * R[:, None, :, 0]
        pull = a @ cross(of, cross(of, e))
        force = -sum_up(cross(e, pull)) - (POLAR * length * spin)[:, None] * cross(w, R[:, :, 0])
        between = np.swapaxes(R[:-1], 1, 2) @ R[1:]
        theta = np.stack([between[:, j, i] - between[:, i, j] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1) / 2
        sine = np.linalg.norm(theta, axis=1, keepdims=True) + 1e-300
        theta = theta * np.arcsin(sine) / sine
        K = skew(theta[:, :, None])
        # in the axes of the segment behind; to the fourth order
        moment = (E - K / 2 + K @ K / 12) @ (springs @ theta[:, :, None])
        moment = (R[1:] @ moment)[:, :, 0]
        force[1:] -= moment
        force[:-1] += moment
        found = np.zeros(3 * bodies)
        found[free] = np.linalg.solve(M.reshape(3 * bodies, -1)[np.ix_(free, free)], force.ravel()[free])
        return np.r_[(skew(w[:, :, None]) @ R).ravel(), found]

    run = solve_ivp(rates, (0.0, t[-1]), np.r_[start.ravel(), np.zeros(3 * bodies)], "DOP853", t, rtol=1e-7, atol=1e-8)
    assert run.success
    return np.einsum("k,kxt->tx", length, run.y[: 9 * bodies].reshape(bodies, 3, 3, -1)[:, :, 0])


def swing(arm, start, t):
    """The tip (N, 2 or 3) and the energy of an arm that is let go at rest."""
    n = arm.n
    still = [ca.substitute(part, arm.s_ddot, 0) for part in (ca.jacobian(arm.residual, arm.s_ddot), arm.residual)]
    equations = ca.Function("equations", [arm.s, arm.s_dot], still)

    def rates(_, x):
        M, left = equations(x[:n], x[n:])
        return np.r_[x[n:], np.linalg.solve(M.full(), -left.full()[:, 0])]

    run = solve_ivp(rates, (0.0, t[-1]), np.r_[start, np.zeros(n)], "DOP853", t, rtol=1e-9, atol=1e-11)
    assert run.success
    energy = np.array([float(arm.functions["energy"](x[:n], x[n:], [])) for x in run.y.T])
    return np.array([arm.functions["points"](x[:n], []).full()[:, -1] for x in run.y.T]), energy


CASES = [("plane", 0.1, 0.005), ("plane", 0.25, 0.02), ("space", 0.25, 2e-3), ("beside", 0.25, 0.02)]


@pytest.mark.slow
@pytest.mark.parametrize(("way", "size", "missed"), CASES)
def test_a_link_swings_as_an_inextensible_curve(way, size, missed):
    """No hub, half the link's mass at its tip, or beside it: against segments by Richardson's rule.

    What is beside gives the tip a moment and a torque, which no shape of a free end has: these converge slowly, however little
    the link bends. With 16 shapes for 6 the linear motion from this start is another by 0.3 %.
    """
    across, up, beside = size * 0.8, size * 0.6, BESIDE * (way == "beside")
    link, t, first = SPATIAL, np.linspace(0.0, 0.05, 6), 1 / FIRST.values(np.ones(1))[0, 0]
    effects = {"payload": {"mass": PAYLOAD, "centre": beside.tolist()}, "bending_torsion_coupling": {}}
    start = np.r_[0.0, across * first, np.zeros(5), up * first, np.zeros(7)]
    if way == "plane":
        across, up, link, effects = size, 0.0, PLANAR, {"payload": {"mass": PAYLOAD}}
        t, start = np.linspace(0.0, 0.15, 16), np.r_[0.0, across * first, np.zeros(3)]
    tip, energy = swing(arm_of(link, effects={"geometric_stiffening": {}, **effects}), start, t)
    coarse, fine = (swing_segments(across, up, count, t, beside) for count in (6, 12))
    exact = (fine + (fine - coarse) / 3)[:, : tip.shape[1]]
    assert np.abs(tip - exact).max() < missed * size
    assert np.ptp(energy) < 1e-8 * energy[0]
