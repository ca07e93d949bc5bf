"""Each effect: its energy or power, what it adds when on, and that it adds nothing when off."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flexlin as fl
from flexlin.scene import known_effects

from .scenes import arm_of, linear, random_state, scene_of, value

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


def sum_of_links(factors):
    """Power of the elastic rates, factors (2,) of omega a mode: clamped-free shapes have int X^2 = 1, int X''^2 = beta^4."""
    omega = np.array([1.87510407, 4.69409113]) ** 2 * np.sqrt(1.0 / (0.2 * 0.5**4))
    return lambda rates: np.sum(factors(omega) * 0.2 * 0.5 * rates[2:].reshape(2, 2) ** 2)


POWERS = {
    "modal_damping": sum_of_links(lambda omega: 2 * np.array([0.01, 0.03]) * omega),
    "rayleigh_damping": sum_of_links(lambda omega: 0.1 + 1e-3 * omega**2),
    "kelvin_voigt_damping": sum_of_links(lambda omega: 2e-3 * omega**2),
    "viscous_friction": lambda q: 0.2 * q[0] ** 2 + 0.1 * q[1] ** 2,
    "coulomb_friction": lambda q: 0.3 * q[0] * np.tanh(q[0] / 0.05) + 0.1 * q[1] * np.tanh(q[1] / 0.05),
    "motor": lambda q: 0.05**2 / 2.0 * (50.0**2 * q[0] ** 2 + 30.0**2 * q[1] ** 2),
}


@pytest.mark.parametrize("name", POWERS)
def test_dissipated_power(name):
    arm = arm_of({}, {}, effects={name: ON[name]})
    for seed in range(3):
        s, s_dot, _ = random_state(arm, seed)
        found, digits = float(s_dot @ value(arm, "damping", s, s_dot)[:, 0]), 1e-8 if "damping" in name else 1e-12
        assert found == pytest.approx(POWERS[name](s_dot), rel=digits)


def test_motor_input_is_the_voltage_and_its_rotor_a_hub():
    """N^2 J_m on joint 1 of a fixed base is a hub's inertia; on joint 2 a hub turns with link 1 too, a geared rotor hardly."""
    geared, plain = arm_of({}, {}, effects={"motor": ON["motor"]}), arm_of({}, {})
    volts = np.diag([50.0 * 0.05 / 2, 30.0 * 0.05 / 2, *[0.0] * 4])[:, :2]
    np.testing.assert_allclose(ca.DM(geared.B).full(), volts, rtol=1e-14)
    s, _, _ = random_state(plain)
    added = np.diag([50.0**2 * 1e-5, 30.0**2 * 1e-5, *[0.0] * 4])
    np.testing.assert_allclose(value(geared, "M", s) - value(plain, "M", s), added, rtol=1e-9, atol=1e-15)


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ON)
def test_an_effect_adds_its_own_coordinates_and_instructions_only(name):
    link = SPATIAL if name == "bending_torsion_coupling" else {}
    effects = ({}, {name: ON[name]}, {name: NEUTRAL.get(name, {})} if name in NEUTRAL else {})
    bare, alone, neutral = (arm_of(link, link, effects=one) for one in effects)
    count = [arm.functions["residual"].n_instructions() for arm in (bare, alone, neutral)]
    assert alone.n - bare.n == ADDED.get(name, 0)
    assert count[0] == count[2] < count[1]  # an effect of no size leaves no trace in the graph


LENGTHS = st.floats(0.2, 1.0)
LINKS = st.fixed_dictionaries(
    {
        "length": LENGTHS,
        "mass_per_length": st.floats(0.1, 1.0),
        "bending_stiffness": st.floats(0.5, 50.0),
        "modes": st.integers(0, 2),
        "mode_shapes": st.sampled_from(["clamped-free", "clamped-loaded", "pinned-free"]),
        "joint": st.sampled_from(["revolute", "revolute", "prismatic"]),
        "mount_angle": st.floats(-3.0, 3.0),
    }
)
FIRST_ONLY = {"hub": {"inertia": 0.02, "mass": 0.1}, "payload": {"mass": 0.1, "inertia": 0.001, "offset": 0.02}}
SCALAR = {
    "joint_flexibility": {"stiffness": 50.0, "motor_inertia": 0.05},
    "bearing_compliance": {"stiffness": 80.0, "damping": 0.3, "inertia": 0.02},
    "viscous_friction": {"coefficient": 0.2},
    "coulomb_friction": {"torque": 0.3, "rate": 0.05},
    "motor": {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": 50.0, "rotor_inertia": 1e-5},
    "rotor_spin": {"inertia": 1e-6, "gear_ratio": -40.0},
}
TABLES = ON | FIRST_ONLY | SCALAR


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    links=st.lists(LINKS, min_size=1, max_size=3),
    names=st.sets(st.sampled_from(sorted(TABLES))),
    seed=st.integers(0, 99),
)
def test_any_chain_obeys_mechanics(links, names, seed):
    arm = arm_of(*links, effects={name: TABLES[name] for name in names})
    s, s_dot, s_ddot = random_state(arm, seed, elastic=0.01)
    M = value(arm, "M", s)
    np.testing.assert_allclose(M, M.T, rtol=0, atol=1e-12 * np.abs(M).max())
    assert np.linalg.eigvalsh(M).min() > 0
    damping = value(arm, "damping", s, s_dot)[:, 0]
    assert "tip_force" in names or s_dot @ damping >= -1e-12
    residual = value(arm, "residual", s, s_dot, s_ddot)[:, 0]
    parts = M @ s_ddot + value(arm, "C", s, s_dot) @ s_dot + value(arm, "g", s)[:, 0] + damping
    np.testing.assert_allclose(residual, parts, rtol=0, atol=1e-10 * (1 + np.abs(residual).max()))
    state = ca.vertcat(arm.s, arm.s_dot)
    change = ca.jtimes(arm.energy, state, ca.vertcat(arm.s_dot, arm.s_ddot))
    rate = float(ca.Function("dE", [arm.s, arm.s_dot, arm.s_ddot], [change])(s, s_dot, s_ddot))
    power = s_dot @ (residual - damping)
    assert abs(rate - power) <= 1e-10 * (1 + np.abs(s_dot) @ np.abs(residual))


@pytest.mark.parametrize("ratio", [-60.0, 60.0])
def test_a_rotor_heavier_than_its_motor_is_refused(ratio):
    """What spin adds is a part of squares that motors and links have: without them M was indefinite, and Floquet judged it."""
    link, spin = {"length": 0.25, "modes": 1}, {"rotor_spin": {"inertia": 1e-4, "gear_ratio": ratio}}

    def scene_with(**motor):
        return scene_of(link, link, effects={"geometric_stiffening": {}, **spin, **motor})

    def flexible(**more):
        return {"joint_flexibility": {"stiffness": 50.0, **more}}

    for motor in ({}, flexible(motor_inertia=0.05)):
        with pytest.raises(fl.errors.ModelError, match=r"M is not positive definite at t = .*effects\.rotor_spin"):
            linear(scene_with(**motor))
    assert np.linalg.eigvalsh(linear(scene_with(**flexible(motor_inertia=0.36))).M(0.1))[0] > 0


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
    bare, found = FLEXIBLE | {"designs": [], "effects.modal_damping": "off"}, []
    for change in ({}, {f"effects.{name}": numbers | {"at": at}}):
        arm = fl.build_manipulator(fl.load_scene("single-link", bare | change))
        found.append(value(arm, "damping", [0.1, 0.2], [0.4, -0.5])[:, 0])
    place, expected = {"joint": 0, "motor": 1}[at], np.zeros(2)
    expected[place] = law([0.4, -0.5][place])
    assert arm.names == ("q1", "theta1")
    assert found[1] - found[0] == pytest.approx(expected, rel=1e-5)


def test_motors_do_not_stick():
    table = {"torque": 0.1, "static": 0.2, "at": "motor"}
    with pytest.raises(fl.errors.SceneError, match="only joints stick"):
        fl.load_scene("single-link", FLEXIBLE | {"effects.coulomb_friction": table})
