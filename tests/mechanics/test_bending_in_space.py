"""Beams bent in two planes, sheared and twisted, and bearings that give across their joint: known frequencies and loads."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import flexlin as fl

from .scenes import arm_of, held, linear, matrices_at_rest, plain_scene
from .spatial import scene_table

BEAM = {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0}


def turning(link, effects, rate=0.0):
    """One link that turns about z at a rate, or stands still."""
    motion = {"kind": "rotation", "joints": [{"rate": rate}], "drive": "prescribed"} if rate else held()
    return plain_scene([link], motion, effects=effects)


@pytest.mark.parametrize(("rate", "flap"), [(0.0, 3.5160), (2.0, 4.1373), (6.0, 7.3604), (12.0, 13.170)])
def test_rotating_blade(rate, flap):
    """Flap across the plane of rotation (Wright et al. 1982), lag in it: lag^2 = flap^2 - Omega^2; from one scene."""
    lin = linear(turning({**BEAM, "modes": {"y": 10, "z": 10}}, {"geometric_stiffening": {}}, rate))
    M, K = lin.M(0.0), lin.K(0.0)
    np.testing.assert_allclose(K[:10, 10:], 0, atol=1e-9)
    parts = np.s_[:10], np.s_[10:]
    lag, flapping = (np.sqrt(eigh(K[part, part], M[part, part], eigvals_only=True)[0]) for part in parts)
    assert flapping == pytest.approx(flap, rel=5e-5)
    assert lag == pytest.approx(np.sqrt(flapping**2 - rate**2), rel=1e-9)


@pytest.mark.parametrize("shapes", ["clamped-free", "clamped-loaded"])
@pytest.mark.parametrize("disc", [0.0, 0.3, 20.0])
def test_torsion_of_a_shaft_with_a_disc(disc, shapes):
    """omega tan(omega l / c) = GJ / (J c), c^2 = GJ / (rho I_p)."""
    length, stiffness, polar = 0.7, 3.0, 0.02
    link = {**BEAM, "length": length, "modes": {"torsion": 4}, "torsional_stiffness": stiffness, "polar_inertia": polar}
    tensor = {"payload": {"mass": 0.0, "tensor": {"xx": disc * polar * length}}} if disc else {}
    lin = linear(turning({**link, "mode_shapes": shapes}, tensor))
    found = np.sqrt(eigh(lin.K(0.0), lin.M(0.0), eigvals_only=True)[0])
    c = np.sqrt(stiffness / polar)
    root = brentq(lambda x: x * np.sin(x) * disc - np.cos(x), 1e-6, np.pi / 2) if disc else np.pi / 2
    assert found == pytest.approx(root * c / length, rel=1e-6)


@pytest.mark.slow
def test_lateral_buckling():
    """A clamped strip under a transverse load at its tip turns over at 4.0126 sqrt(EI_z GJ) / l^2 (Timoshenko, Gere)."""
    length, weak, twist = 1.3, 0.4, 0.25
    link = {"length": length, "mass_per_length": 1e-6, "bending_stiffness": [900.0, weak], "polar_inertia": 1e-6}
    link |= {"modes": {"y": 8, "z": 1, "torsion": 5}, "torsional_stiffness": twist}
    effects = {"gravity": {"direction": [0, 0, -1]}, "payload": {"mass": 0.1}, "geometric_stiffening": {}}
    scene = turning(link, {**effects, "bending_torsion_coupling": {}})
    arm = fl.build_manipulator(scene, ["effects.payload.mass"])
    state = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    K = ca.Function("K", [state, arm.parameters.symbols], [ca.jacobian(arm.residual, arm.s)[1:, 1:]])

    def lowest(mass):
        return np.linalg.eigvalsh(np.array(K(np.zeros(3 * arm.n), mass))).min()

    load = 4.0126 * np.sqrt(weak * twist) / length**2
    assert lowest(0.9 * load / 9.81) > 0 > lowest(1.1 * load / 9.81)
    assert 9.81 * brentq(lowest, 0.9 * load / 9.81, 1.1 * load / 9.81) == pytest.approx(load, rel=1e-3)


OMEGA_0 = np.sqrt(1.0 / (0.2 * 0.5**4))  # sqrt(EI / (rho A l^4)) of the tests' link


def cantilever(effects):
    """Frequencies of one link with its joint locked."""
    M, K = matrices_at_rest(arm_of({"modes": 3}, effects=effects))
    return np.sqrt(eigh(K[1:, 1:], M[1:, 1:], eigvals_only=True))[:3]


def timoshenko_cantilever(count, gyration, shear):
    """Exact frequencies of a unit cantilever: state (w, psi, M, Q), exp of the state matrix, free end; no modes anywhere."""

    def determinant(omega):
        A = np.zeros((4, 4))
        A[0, 1], A[0, 3] = 1.0, 1 / shear
        A[1, 2] = 1.0
        A[2, 1], A[2, 3] = -(omega**2) * gyration**2, -1.0
        A[3, 0] = -(omega**2)
        return np.linalg.det(expm(A)[2:, 2:])

    grid = np.linspace(1.0, 70.0, 300)
    signs = np.sign([determinant(omega) for omega in grid])
    ends = np.flatnonzero(signs[:-1] != signs[1:])[:count]
    return np.array([brentq(determinant, grid[i], grid[i + 1], xtol=1e-13) for i in ends])


def test_timoshenko_against_the_exact_solution():
    """r = 0.05 l and kappa G A l^2 / EI = l^2 / (3 r^2): a stubby steel beam."""
    gyration, shear = 0.05, 1 / (3 * 0.05**2)
    effects = {"rotary_inertia": {"radius_of_gyration": gyration * 0.5}, "shear": {"stiffness": shear / 0.5**2}}
    exact = timoshenko_cantilever(3, gyration, shear) * OMEGA_0
    np.testing.assert_allclose(cantilever(effects), exact, rtol=1e-9)
    assert np.all(cantilever({"shear": effects["shear"]}) > exact * 1.0001)  # rotary inertia slows every mode


@pytest.mark.parametrize("spin", [0.0, 3.0, 40.0])
def test_a_rotor_on_a_soft_bearing_whirls(spin):
    """J_t b'' + i J_p Omega b' + d b' + k b = 0 with b = beta_1 + i beta_2: forward and backward whirl (Genta, section 4.6)."""
    k, d, across_axis, along = 30.0, 0.02, 0.05, 0.08
    body = {"mass": 2.0, "inertia": {"xx": across_axis, "yy": across_axis, "zz": along}}
    motion = {"kind": "rotation", "drive": "prescribed", "joints": [{"rate": spin}]} if spin else held()
    soft = {"bearing_compliance": {"stiffness": k, "damping": d}}
    found = np.linalg.eigvals(linear(plain_scene([{"body": body}], motion, effects=soft)).A(0.0))
    whirl = np.roots([across_axis, d - 1j * along * spin, k])
    expected = np.concatenate([whirl, whirl.conj()])
    apart = np.abs(found[:, None] - expected)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-9 * np.abs(expected).max()


def test_a_bearing_that_does_not_give_has_no_coordinates():
    links = [{"body": {"mass": 1.0, "centre": [0.3, 0, 0]}, "joint": "revolute"}] * 2
    table = scene_table(links, bearing_compliance={"stiffness": [0.0, 5.0]})
    assert fl.build_manipulator(fl.parse_scene(table)).names == ("q1", "q2", "beta21", "beta22")
    weighted = {"name": "d", "kind": "periodic-lqr", "state_weight": [1.0] * 8, "input_weight": [1.0, 1.0]}
    assert len(fl.parse_scene({**table, "designs": [weighted]}).designs[0].state_weight) == 8
    with pytest.raises(fl.errors.SceneError, match=r"8, one for each state"):
        fl.parse_scene({**table, "designs": [{**weighted, "state_weight": [1.0] * 4}]})
    with pytest.raises(fl.errors.SceneError, match=r"effects\.bearing_compliance\.stiffness"):
        fl.parse_scene({**table, "effects": {"bearing_compliance": {"stiffness": -1.0}}})
