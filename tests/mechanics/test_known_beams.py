"""Known frequencies and loads of beams in space: bent, sheared and twisted, on bearings that give, under forces at their tips.

A unit column l = EI = rhoA = 1, clamped at its base; eight clamped-free modes come from above to within 1.3e-4 of its buckling load.
"""

import numpy as np
import pytest
from scipy.linalg import eigh, eigvals, expm
from scipy.optimize import brentq, root
from scipy.special import jv

import flexlin as fl
from flexlin.motion import SampledMotion

from .scenes import arm_of, held, linear, matrices_at_rest, plain_scene, scene_of, value
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


def column(effects, angle=0.0):
    """M and K of the unit column with eight modes, its joint held at an angle."""
    lin = linear(plain_scene([{**BEAM, "modes": 8}], held(angle), effects={"geometric_stiffening": {}, **effects}))
    return lin.M(0.0), lin.K(0.0)


def push(load, frame="world", angle=0.0):
    """A force against the column's axis, which stands at an angle in that frame."""
    return {"tip_force": {"force": [-load * np.cos(angle), -load * np.sin(angle), 0.0], "frame": frame}}


def smallest_load(loaded, angle=0.0):
    """The smallest P with det(K_0 + P (K_1 - K_0)) = 0: K is linear in the load."""
    bare = column({}, angle)[1]
    found = eigvals(bare, bare - column(loaded, angle)[1])
    return float(found[(abs(found.imag) < 1e-9) & (found.real > 0)].real.min())


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_euler_buckling(angle):
    """P = pi^2 EI / (4 l^2), at any angle of the column against the world."""
    assert 0 < smallest_load(push(1.0, angle=angle), angle) / (np.pi**2 / 4) - 1 < 1.3e-4


def test_buckling_under_the_own_weight():
    """q l^3 = 7.8373 EI, where J_-1/3(2/3 sqrt(q)) = 0 (Greenhill 1881)."""
    exact = brentq(lambda q: jv(-1 / 3, 2 / 3 * np.sqrt(q)), 7.0, 8.5)
    assert 0 < smallest_load({"gravity": {"acceleration": 1.0, "direction": [-1.0, 0.0, 0.0]}}) / exact - 1 < 1e-5


def test_beck_column():
    """A follower never buckles the column; at P = 20.05 EI/l^2 two frequencies meet at omega = 11.02 (Beck 1952)."""
    (M, bare), (_, unit) = column({}), column(push(1.0, "tip"))

    def squares(load):
        found = eigvals(bare + load * (unit - bare), M)
        return found[np.argsort(found.real)]

    low, high = 10.0, 30.0
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (low, middle) if abs(squares(middle)[:2].imag).max() > 1e-6 else (middle, high)
    assert low == pytest.approx(20.0509, rel=1e-4)
    assert np.sqrt(squares(low)[0].real) == pytest.approx(11.016, rel=1e-3)
    assert all(np.linalg.det(bare + load * (unit - bare)) > 0 for load in np.linspace(0.0, 20.0, 9))


def characteristic(load, follows):
    """Determinant of EI w'''' + P w'' = rhoA omega^2 w, w = w' = 0 at the base, w'' = 0 and w''' + P w' (follower: w''') = 0 at the tip."""

    def determinant(omega):
        roots = np.roots([1.0, 0.0, load, 0.0, -(omega**2)]).astype(complex)
        tip = np.exp(roots)
        shear = roots**3 + (0 if follows else load * roots)
        found = np.linalg.det(np.array([np.ones(4), roots, roots**2 * tip, shear * tip]))
        return float((found / np.linalg.det(np.vander(roots))).real)

    return determinant


@pytest.mark.parametrize(("load", "frame"), [(2.0, "world"), (-5.0, "world"), (8.0, "tip"), (-5.0, "tip")])
def test_prestressed_frequencies(load, frame):
    M, K = column(push(load, frame))
    exact = characteristic(load, frame == "tip")
    for omega in np.sqrt(np.sort(eigvals(K, M).real)[:2]):
        assert brentq(exact, 0.97 * omega, 1.03 * omega) == pytest.approx(omega, rel=2e-3)


def shaken():
    """A unit column with one mode, its joint held, under a harmonic of a motion of 0.4 s."""
    load = {"force": [0.0, 1e-3, 0.0], "harmonic": 3, "phase": 0.4}
    effects = {"tip_force": load, "modal_damping": {"ratio": 0.1}}
    return plain_scene([{**BEAM, "modes": 1}], held(frequency=2.5), effects=effects)


def test_a_periodic_force_shakes_a_beam():
    """w = Re(X(l) F e^(i (3 W t + phase)) / (w1^2 - (3 W)^2 + 2 i z w1 3 W)), X(l) = 2, w1 = 1.8751^2; simulated, too."""
    lin, t = linear(shaken()), np.linspace(0.0, 0.4, 9)
    W, w1 = 3 * 2 * np.pi * 2.5, 1.8751040687119611**2
    phasor = 2e-3 * np.exp(1j * (W * t + 0.4)) / (w1**2 - W**2 + 0.2j * w1 * W)
    expected = np.stack([phasor.real, (1j * W * phasor).real], axis=1)
    np.testing.assert_allclose(fl.forced_response(lin.periodic_system(), lin.forcing)(t), expected, atol=1e-12)
    run = fl.simulate(lin, 1.0, initial=expected[0], tol=1e-9, points_per_period=8)
    np.testing.assert_allclose(run.nonlinear, expected, atol=1e-8)
    assert run.energy_error < 1e-5


def test_a_periodic_force_along_a_motion_of_numbers():
    """What the place on the motion is passed by, a phase or angles, makes no difference; nor does one equation or all."""
    scene = shaken()
    arm, t = fl.build_manipulator(scene), np.array([0.0, 0.05, 0.31])
    still = SampledMotion(1, 0.4, (True,), sampler=lambda t: (np.zeros((len(t), 1)),) * 3)
    by_phase, by_angles = fl.linearize(arm, scene.motion), fl.linearize(arm, still)
    np.testing.assert_allclose(by_angles.h(t), by_phase.h(t), atol=1e-15)
    np.testing.assert_allclose(by_phase.h(t)[:, 0], 2e-3 * np.cos(6 * np.pi * t / 0.4 + 0.4), rtol=1e-10)
    whole = by_phase.about.of_arm("residual", t, *np.zeros((3, 3, 1)))
    np.testing.assert_allclose(whole[:, 1, 0], -by_phase.h(t)[:, 0], rtol=1e-12)


def test_a_load_grows_with_the_square_of_the_first_joints_rate():
    """The torque F l (q'/r)^2 of a rigid link, alike to and fro; about a rotation it is D_L = -2 F l Omega/r^2."""
    load = {"tip_force": {"force": [0.0, 2.0, 0.0], "frame": "tip", "rate": 3.0}}
    arm = arm_of({"length": 0.7, "modes": 0}, effects=load)
    for rate in (-6.0, 0.0, 1.5):
        assert value(arm, "damping", [0.4], [rate]).item() == pytest.approx(-2.0 * 0.7 * (rate / 3) ** 2, abs=1e-15)
    lin = fl.linearize(arm, {"kind": "rotation", "joints": [{"rate": -5.0}]})
    assert lin.D(0.1).item() == pytest.approx(2 * 2.0 * 0.7 * 5.0 / 9, rel=1e-13)


def test_a_force_across_a_cantilever_bends_it_into_the_elastica():
    """Both components of the tip's way at P l^2/EI = 1, 2, 5, 10 (Bisshopp, Drucker 1945; Mattiasson 1981)."""
    load = {"geometric_stiffening": {}, "tip_force": {"force": [0.0, 1.0, 0.0]}}
    arm = fl.build_manipulator(scene_of({**BEAM, "modes": 6}, effects=load), ["effects.tip_force.force.1"])
    residual, points, still = arm.functions["residual"], arm.functions["points"], np.zeros(arm.n)
    found = []
    for P in (1.0, 2.0, 5.0, 10.0):
        bent = root(lambda w, P=P: residual([0.0, *w], still, still, P).full()[1:, 0], np.zeros(6), tol=1e-10)
        assert bent.success
        found.append(points([0.0, *bent.x], P).full()[:, -1])
    across, along = [0.30172, 0.49346, 0.71379, 0.81061], [0.05643, 0.16064, 0.38763, 0.55500]
    np.testing.assert_allclose(found, np.column_stack([1 - np.array(along), across]), atol=7e-5)
