"""Effects: what they add when on, that they add nothing when off, and what obeys mechanics whatever is on."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import known_effects

from .scenes import arm_of, linear, random_state, scene_of, value
from .test_jury import effect_tables, random_scene

SPATIAL = {"modes": {"y": 1, "z": 1, "torsion": 1}, "torsional_stiffness": 0.8, "polar_inertia": 1e-3}
"""A link that deflects in every way."""
ADDED = {"joint_flexibility": 1, "bearing_compliance": 2}
"""Of two joints one gives."""
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
@pytest.mark.parametrize("name", known_effects())
def test_an_effect_adds_its_own_coordinates_and_instructions_only(name):
    on = {"hub": {"inertia": 0.02}} | effect_tables(np.random.default_rng(0), False, [0.02, 0.02])
    link = SPATIAL if name == "bending_torsion_coupling" else {}
    effects = ({}, {name: on[name]}, {name: NEUTRAL.get(name, {})} if name in NEUTRAL else {})
    bare, alone, neutral = (arm_of(link, link, effects=one) for one in effects)
    count = [arm.functions["residual"].n_instructions() for arm in (bare, alone, neutral)]
    assert alone.n - bare.n == ADDED.get(name, 0)
    assert count[0] == count[2] < count[1]  # an effect of no size leaves no trace in the graph


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_any_tree_obeys_mechanics(seed):
    """At states far from the rigid motion, without what does work on it."""
    arm = fl.build_manipulator(random_scene(seed, tip_force={}))
    s, s_dot, s_ddot = random_state(arm, seed, elastic=0.01)
    M = value(arm, "M", s)
    np.testing.assert_allclose(M, M.T, rtol=0, atol=1e-12 * np.abs(M).max())
    assert np.linalg.eigvalsh(M).min() > 0
    damping = value(arm, "damping", s, s_dot)[:, 0]
    assert s_dot @ damping >= -1e-12
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


@pytest.mark.parametrize("at", ["joint", "motor"])
def test_grease_resists_by_a_power_of_the_rate(at):
    grease = {"coefficient": 0.7, "exponent": 0.4, "rate": 1e-3, "at": at}
    bare, found = FLEXIBLE | {"designs": [], "effects.modal_damping": "off"}, []
    for change in ({}, {"effects.viscous_friction": grease}):
        arm = fl.build_manipulator(fl.load_scene("single-link", bare | change))
        found.append(value(arm, "damping", [0.1, 0.2], [0.4, -0.5])[:, 0])
    expected = {"joint": [0.7 * 0.4**0.4, 0.0], "motor": [0.0, -0.7 * 0.5**0.4]}[at]
    assert arm.names == ("q1", "theta1")
    assert found[1] - found[0] == pytest.approx(expected, rel=1e-5)
