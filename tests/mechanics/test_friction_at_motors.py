"""Friction of motors before a flexible joint's spring: it resists theta', and nothing of q'."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl

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
