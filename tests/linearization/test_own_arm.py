"""A manipulator of one's own: motions as dicts, inputs that cannot lead its joints, and what its objects show."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl

MOTION = {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.3}]}


def cart_with_pole(**given):
    """A cart with a pole that is held up by a spring (5 N m/rad), standing up at zero."""
    s, v = ca.SX.sym("s", 2), ca.SX.sym("v", 2)
    tip = ca.vertcat(v[0] + 0.5 * ca.cos(s[1]) * v[1], -0.5 * ca.sin(s[1]) * v[1])
    T, V = v[0] ** 2 + 0.1 * ca.sumsqr(tip), 0.2 * 9.81 * 0.5 * ca.cos(s[1]) + 2.5 * s[1] ** 2
    return fl.Manipulator.from_lagrangian(s, v, T, V, **{"names": ("x", "phi"), "joints": [0]} | given)


def test_a_dict_is_a_motion_table():
    arm = cart_with_pole()
    by_dict = fl.linearize(arm, MOTION)
    by_table = fl.linearize(arm, fl.build_motion(MOTION, 1))
    np.testing.assert_array_equal(by_dict.h([0.1, 0.6]), by_table.h([0.1, 0.6]))
    # by hand: x = 0.3 sin(pi t), at phi = 0 the pole's equation is 0.05 phi'' + 0.1 x'' + (5 - 0.981) phi = 0
    K, h = by_dict.K(0.5), by_dict.h(0.5)
    assert K[1, 1] == pytest.approx(5 - 0.981, rel=1e-12)
    assert h[1] == pytest.approx(0.1 * 0.3 * np.pi**2, rel=1e-12)


@pytest.mark.parametrize(
    ("table", "match"),
    [
        ({}, "motion.kind"),
        ({"kind": "harmonics"}, "motion.kind"),
        ({**MOTION, "frequncy": 1.0}, "frequncy"),
        ({**MOTION, "frequency": -1.0}, "frequency"),
        ({**MOTION, "frequency": 10**400}, "frequency"),
    ],
)
def test_a_wrong_table_is_refused_key_by_key(table, match):
    with pytest.raises(fl.errors.SceneError, match=match):
        fl.linearize(cart_with_pole(), table)


@pytest.mark.parametrize(
    "given",
    [
        {"B": ca.DM([[1], [0]]), "joints": [0, 1]},
        {"B": ca.DM([[1], [-1]]), "joints": None},
        {"B": ca.DM([[1, 0], [0, 1]]), "joints": [0]},
        {"B": ca.DM([[0, 0], [1, 1]]), "joints": [0, 1]},
        {"B": ca.DM([[1, 1], [1, 1]]), "joints": [0, 1]},
        {"B": ca.DM([[0], [1]]), "joints": [0]},
        {"joints": [2]},
        {"joints": [0, 0]},
    ],
)
def test_inputs_that_cannot_lead_the_joints_are_refused(given):
    with pytest.raises(fl.errors.ModelError, match="joints"):
        fl.linearize(cart_with_pole(**given), {**MOTION, "joints": [{"amplitude": 0.3}] * len(given["joints"] or ())})


def test_each_joint_has_its_own_input_in_the_order_of_the_joints():
    arm = cart_with_pole(joints=(1, 0))
    lin = fl.linearize(arm, {**MOTION, "joints": [{"amplitude": 0.0}, {"amplitude": 0.3}]})
    np.testing.assert_array_equal(lin.B(0.0), [[0, 1], [1, 0]])
    np.testing.assert_allclose(lin.h(0.3) + lin.B(0.3) @ lin.feedforward(0.3), 0, atol=1e-12)


def test_what_no_input_balances_is_said():
    lin = fl.linearize(cart_with_pole(), MOTION)
    assert "0.296 N in phi that no input balances" in lin.summary()  # 0.1 * 0.3 pi^2, by hand
    rest = fl.linearize(cart_with_pole(), {**MOTION, "joints": [{"amplitude": 0.0}]})
    assert "balances" not in rest.summary()


def test_tables_and_states_say_the_numbers_of_the_equations():
    lin = fl.linearize(cart_with_pole(), MOTION)
    system = lin.periodic_system()
    modes = fl.floquet_modes(system)
    np.testing.assert_array_equal(modes.to_dataframe().growth_rate, modes.exponents.real)
    np.testing.assert_array_equal(lin.to_xarray(3).K.sel(equation="phi", coordinate="x"), lin.K([0, 1, 2])[:, 1, 0])
    for t in (0.3, [0.3]):
        np.testing.assert_array_equal(lin.A(t), system.A(t))
        np.testing.assert_array_equal(np.shape(lin.forcing(t)), (*np.shape(t), 4))


def test_a_control_may_be_a_dict_of_its_keys():
    scene = fl.load_scene("single-link", {"designs": []})
    arm = fl.build_manipulator(scene)
    given = {"feedback": {"kind": "pd", "kp": [3.0], "kd": [0.4]}}
    same = fl.load_scene("single-link", {"designs": [], "control": given})
    made = fl.linearize(arm, scene.motion, given)
    t = np.linspace(0.0, 1.0, 5)
    assert (made.law.gain(t) == fl.linearize(arm, same.motion, same.control).law.gain(t)).all()
    with pytest.raises(fl.errors.SceneError, match=r"control.feedback.kind.*did you mean 'pd'"):
        fl.linearize(arm, scene.motion, {"feedback": {"kind": "pdd"}})
