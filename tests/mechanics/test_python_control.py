"""The nonlinear arm in python-control: its simulation, its linearization at rest, its parameters and loads."""

import numpy as np
import pytest

import flexlin as fl

from .scenes import arm_of, random_state, value

PAYLOAD = "effects.payload.mass"


def falling(angle: float = -1.2, payload: float = 0.03) -> tuple[fl.Scene, fl.Linearization]:
    """The single link at rest, without control: it falls."""
    joints = [{"mean": angle, "amplitude": 0.0}]
    free = {"motion.joints": joints, "control.feedforward": "none", "control.feedback": {"kind": "none"}}
    scene = fl.load_scene("single-link", {"designs": [], **free, "effects.payload.mass": payload})
    return scene, fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)


def test_names():
    flexible = {"joint_flexibility": {"stiffness": [50.0, 0.0], "motor_inertia": 0.05}}
    plant = arm_of({}, {"modes": 0}, effects=flexible).to_control("plant")
    assert plant.name == "plant"
    assert plant.state_labels == plant.output_labels
    assert plant.state_labels[:4] == ["q1", "q2", "w11", "w12"]
    assert plant.state_labels[-1] == "theta1_rate"
    assert plant.input_labels == ["theta1", "q2"]


def test_its_rates_solve_the_equations():
    """M s'' + C s' + g + d = B u, by the arm's own residual."""
    motor = {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": 50.0}
    arm = arm_of({}, {}, effects={"gravity": {}, "geometric_stiffening": {}, "motor": motor})
    s, s_dot, _ = random_state(arm)
    u = np.array([3.0, -2.0])
    rates = arm.to_control().dynamics(0.0, np.concatenate([s, s_dot]), u)
    np.testing.assert_array_equal(rates[: arm.n], s_dot)
    left = value(arm, "residual", s, s_dot, rates[arm.n :])[:, 0]
    np.testing.assert_allclose(left, np.append(1.25 * u, np.zeros(4)), atol=1e-10)


def test_free_parameters_are_those_of_the_system():
    scene, _ = falling()
    arm = fl.build_manipulator(scene, [PAYLOAD])
    plant, x, u = arm.to_control(), np.array([-1.0, 0.01, 0.0, 0.2, 0.0, 0.1]), np.zeros(1)
    assert plant.params == {PAYLOAD: scene.effects.payload.mass}
    heavy, found = falling(payload=0.3)[1].arm.to_control(), plant.dynamics(0.0, x, u, params={PAYLOAD: 0.3})
    np.testing.assert_allclose(found, heavy.dynamics(0.0, x, u), rtol=1e-10)


def test_a_periodic_load_needs_the_period():
    arm = arm_of({"modes": 0}, effects={"tip_force": {"torque": [0.0, 0.0, 0.4], "harmonic": 2}})
    with pytest.raises(fl.errors.ArgumentError, match="a periodic load needs a period"):
        arm.to_control()
    plant, inertia = arm.to_control(period=0.5), value(arm, "M", np.zeros(1))[0, 0]
    found = [plant.dynamics(t, np.zeros(2), np.zeros(1))[1] for t in (0.0, 0.05, 0.625)]
    np.testing.assert_allclose(found, 0.4 / inertia * np.cos(8 * np.pi * np.array([0.0, 0.05, 0.625])), atol=1e-9)
