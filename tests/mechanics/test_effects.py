"""Each effect: what it adds when on, and that it adds nothing when off; sections and friction by closed forms."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import brentq

import flexlin as fl
from flexlin.scene import known_effects

from .scenes import arm_of, matrices_at_rest

ON = {
    "gravity": {"acceleration": 9.81},
    "payload": {"mass": [0.05, 0.1], "inertia": [0.001, 0.002], "offset": [0.0, 0.03]},
    "hub": {"mass": [0.3, 0.2], "inertia": [0.02, 0.01], "radius": [0.04, 0.02]},
    "geometric_stiffening": {},
    "bending_torsion_coupling": {},
    "rotary_inertia": {"radius_of_gyration": 0.02},
    "shear": {"stiffness": 300.0},
    "modal_damping": {"ratio": [0.01, 0.03]},
    "rayleigh_damping": {"mass_factor": 0.1, "stiffness_factor": 1e-3},
    "kelvin_voigt_damping": {"retardation_time": 2e-3},
    "joint_flexibility": {"stiffness": [50.0, 30.0], "motor_inertia": [0.05, 0.02]},
    "bearing_compliance": {"stiffness": [80.0, 60.0], "damping": [0.3, 0.2], "inertia": [0.03, 0.02]},
    "viscous_friction": {"coefficient": [0.2, 0.1]},
    "coulomb_friction": {"torque": [0.3, 0.1], "rate": 0.05},
    "motor": {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": [50.0, 30.0], "rotor_inertia": 1e-5},
    "rotor_spin": {"inertia": [1e-4, 2e-5], "gear_ratio": [-60.0, 50.0]},
    "tip_force": {"force": [1.0, -2.0, 0.0], "torque": [0.0, 0.0, 0.3], "frame": "tip"},
}
SPATIAL = {"modes": {"y": 1, "z": 1, "torsion": 1}, "torsional_stiffness": 0.8, "polar_inertia": 1e-3}
"""A link that deflects in every way."""
ADDED = {"joint_flexibility": 2, "bearing_compliance": 4}


def test_all_effects_are_covered():
    assert set(ON) == set(known_effects())


def test_motor_input_is_the_voltage():
    arm = arm_of({}, {}, effects={"motor": ON["motor"]})
    B = np.array(ca.DM(arm.B))
    np.testing.assert_allclose(B[:2], np.diag([50.0 * 0.05 / 2, 30.0 * 0.05 / 2]), rtol=1e-14)
    assert not B[2:].any()


NEUTRAL = {
    "gravity": {"acceleration": 0.0},
    "payload": {"mass": 0.0},
    "hub": {},
    "rotary_inertia": {"radius_of_gyration": 0.0},
    "modal_damping": {"ratio": 0.0},
    "rayleigh_damping": {},
    "kelvin_voigt_damping": {"retardation_time": 0.0},
    "viscous_friction": {"coefficient": [0.0, 0.0]},
    "coulomb_friction": {"torque": 0.0},
    "rotor_spin": {"inertia": 0.0, "gear_ratio": 100.0},
    "tip_force": {},
}


def instructions(arm):
    return arm.functions["residual"].n_instructions()


@pytest.mark.slow
@pytest.mark.parametrize("name", ON)
def test_an_effect_adds_its_own_coordinates_and_instructions_only(name):
    link = SPATIAL if name == "bending_torsion_coupling" else {}
    bare, alone = arm_of(link, link), arm_of(link, link, effects={name: ON[name]})
    assert alone.n - bare.n == ADDED.get(name, 0)
    assert instructions(alone) > instructions(bare)
    if name in NEUTRAL:  # an effect of no size leaves no trace in the graph
        assert instructions(arm_of({}, {}, effects={name: NEUTRAL[name]})) == instructions(bare)


OMEGA_0 = np.sqrt(1.0 / (0.2 * 0.5**4))  # sqrt(EI / (rho A l^4)) of the tests' link


def cantilever(effects, modes=8):
    """Frequencies of one link with its joint locked."""
    M, K = matrices_at_rest(arm_of({"modes": modes}, effects=effects))
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
    effects = {
        "rotary_inertia": {"radius_of_gyration": gyration * 0.5},
        "shear": {"stiffness": shear / 0.5**2},
    }
    exact = timoshenko_cantilever(3, gyration, shear) * OMEGA_0
    np.testing.assert_allclose(cantilever(effects, 3), exact, rtol=1e-9)
    assert np.all(cantilever({"shear": effects["shear"]}, 3) > exact * 1.0001)  # rotary inertia slows every mode


FLEXIBLE = {"links.0.modes": 0, "effects.joint_flexibility": {"stiffness": 10.0, "motor_inertia": 0.1}}
GREASE = {"coefficient": 0.7, "exponent": 0.4, "rate": 1e-3}
LAWS = [
    ("viscous_friction", {"coefficient": 0.7}, lambda rate: 0.7 * rate),
    ("viscous_friction", GREASE, lambda rate: 0.7 * np.sign(rate) * abs(rate) ** 0.4),
    ("coulomb_friction", {"torque": 0.3, "rate": 0.2}, lambda rate: 0.3 * np.tanh(rate / 0.2)),
]


@pytest.mark.parametrize(("name", "numbers", "law"), LAWS)
@pytest.mark.parametrize("at", ["joint", "motor"])
def test_it_resists_the_rate_that_it_is_said_to(name, numbers, law, at):
    kept = {"effects.modal_damping": "off"}
    scene = fl.load_scene("single-link", FLEXIBLE | {f"effects.{name}": numbers | {"at": at}, "designs": []} | kept)
    arm = fl.build_manipulator(scene)
    found = np.array(ca.Function("d", [arm.s, arm.s_dot], [arm.damping])([0.1, 0.2], [0.4, -0.5]))[:, 0]
    before = fl.build_manipulator(fl.load_scene("single-link", FLEXIBLE | {"designs": []} | kept))
    others = np.array(ca.Function("d", [before.s, before.s_dot], [before.damping])([0.1, 0.2], [0.4, -0.5]))[:, 0]
    place = {"joint": 0, "motor": 1}[at]
    expected = np.zeros(2)
    expected[place] = law([0.4, -0.5][place])
    assert arm.names == ("q1", "theta1")
    assert found - others == pytest.approx(expected, rel=1e-5)


def test_motors_do_not_stick():
    table = {"torque": 0.1, "static": 0.2, "at": "motor"}
    with pytest.raises(fl.errors.SceneError, match="only joints stick"):
        fl.load_scene("single-link", FLEXIBLE | {"effects.coulomb_friction": table})
