"""A user's own models: what is right passes, each mistake is named. The nonlinear arm in python-control."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ModelError

from .scenes import arm_of, random_state, swinging, value

S, RATE = ca.SX.sym("s", 2), ca.SX.sym("s_dot", 2)
COS, SIN = ca.cos(S[1]), ca.sin(S[1])


def two_rods(**wrong):
    """Two rods of unit length and mass, joint angles relative; `wrong` replaces a matrix."""
    h = SIN / 2
    parts = {
        "M": ca.blockcat([[5 / 3 + COS, 1 / 3 + COS / 2], [1 / 3 + COS / 2, 1 / 3]]),
        "C": ca.blockcat([[-h * RATE[1], -h * (RATE[0] + RATE[1])], [h * RATE[0], 0]]),
        "g": 9.81 * ca.vertcat(1.5 * ca.cos(S[0]) + 0.5 * ca.cos(S[0] + S[1]), 0.5 * ca.cos(S[0] + S[1])),
    }
    return fl.Manipulator.from_matrices(S, RATE, **(parts | wrong))


def changed(matrix, i, j, value):
    copy = ca.SX(matrix)
    copy[i, j] = value
    return copy


def test_a_right_model_passes_and_equals_its_lagrangian():
    arm = two_rods()
    T, V = ca.bilin(arm.M, RATE, RATE) / 2, 9.81 * (1.5 * ca.sin(S[0]) + 0.5 * ca.sin(S[0] + S[1]))
    other = fl.Manipulator.from_lagrangian(S, RATE, T, V)
    state = np.random.default_rng(0).normal(size=(3, 2))
    np.testing.assert_allclose(value(arm, "residual", *state), value(other, "residual", *state), rtol=1e-12)


def test_any_true_factorisation_of_the_coriolis_forces_passes():
    """C = dM/ds (I (x) s') - 1/2 (dM/ds (s' (x) I))^T is not skew with M', but is the same force."""
    M = two_rods().M
    dM = fl.kronecker.derivative(M, S)
    eye = ca.DM.eye(2)
    other = two_rods(C=dM @ ca.kron(eye, RATE) - (dM @ ca.kron(RATE, eye)).T / 2)
    state = np.random.default_rng(1).normal(size=(3, 2))
    np.testing.assert_allclose(value(other, "residual", *state), value(two_rods(), "residual", *state), rtol=1e-12)
    assert np.abs(value(other, "C", *state[:2]) - value(two_rods(), "C", *state[:2])).max() > 1e-3


RIGHT = two_rods()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"M": changed(RIGHT.M, 0, 1, 0.4)}, r"M is not symmetric.*M\[1, 0\].*M\[0, 1\]|M\[0, 1\].*M\[1, 0\]"),
        ({"M": changed(RIGHT.M, 1, 1, -0.1)}, r"not positive definite.*M\[1, 1\]"),
        ({"M": changed(RIGHT.M, 1, 1, 1 / (S[0] - S[0] * 1.0))}, r"M\[1, 1\] is not finite"),
        ({"M": changed(RIGHT.M, 1, 1, 1 + RATE[0] ** 2)}, r"M\[1, 1\] depends on the rates"),
        ({"C": changed(RIGHT.C, 1, 0, -SIN / 2 * RATE[0])}, r"row 1 of C s' the product s1' s1'.*skew"),
        ({"C": ca.SX.zeros(2, 2)}, "C does not belong to M"),
        ({"g": changed(RIGHT.g, 1, 0, ca.sin(S[0]))}, r"dg/ds is not symmetric"),
        ({"g": changed(RIGHT.g, 1, 0, RATE[0])}, r"g\[1, 0\] depends on the rates"),
        ({"damping": ca.vertcat(ca.log(S[0] - 7), 0)}, r"damping\[0, 0\] is not finite"),
        ({"g": RIGHT.g[0]}, "g has the wrong shape"),
        ({"g": RIGHT.g + ca.SX.sym("mystery")}, "mystery"),
    ],
)
def test_each_mistake_is_named(wrong, message):
    with pytest.raises(ModelError, match=message):
        two_rods(**wrong)


@pytest.mark.parametrize(
    ("T", "V", "says"),
    [
        (RATE[0] ** 2, S[0] ** 2, "not positive definite"),
        (ca.sumsqr(RATE), S[0] * RATE[0], "rates"),
        (ca.sumsqr(RATE) ** 2 + ca.sumsqr(RATE), S[0] ** 2, "rates"),
        (ca.sumsqr(RATE) / 2 + RATE[1] * SIN, ca.SX(0), "linear in rate 1"),
        (ca.sumsqr(RATE) / 2 + 1 + S[0] ** 2, ca.SX(0), "free of the rates"),
    ],
)
def test_energies_must_be_mechanical(T, V, says):
    """The Kronecker route knows M and C only: a part of T that is not quadratic would be lost in silence."""
    with pytest.raises(ModelError, match=says):
        fl.Manipulator.from_lagrangian(S, RATE, T, V)


def test_a_model_must_stay_finite_along_the_motion():
    """A root of 1.2 - s1 is sound about rest, and not where the motion goes."""
    arm = fl.Manipulator.from_lagrangian(S, RATE, ca.sumsqr(RATE), ca.sumsqr(S) + (1.2 - S[0]) ** 1.5)
    with pytest.raises(ModelError, match=r"K_L\[0, 0\] is not finite along the motion, at t = "):
        fl.linearize(arm, swinging({"amplitude": 1.5}, {"amplitude": 0.1}))


PAYLOAD = "effects.payload.mass"


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
    plain, heavy = (fl.load_scene("single-link", {"designs": []} | more) for more in ({}, {PAYLOAD: 0.3}))
    plant, x, u = fl.build_manipulator(plain, [PAYLOAD]).to_control(), [-1.0, 0.01, 0.0, 0.2, 0.0, 0.1], np.zeros(1)
    assert plant.params == {PAYLOAD: plain.effects.payload.mass}
    expected = fl.build_manipulator(heavy).to_control().dynamics(0.0, x, u)
    np.testing.assert_allclose(plant.dynamics(0.0, x, u, params={PAYLOAD: 0.3}), expected, rtol=1e-10)


def test_a_periodic_load_needs_the_period():
    arm = arm_of({"modes": 0}, effects={"tip_force": {"torque": [0.0, 0.0, 0.4], "harmonic": 2}})
    with pytest.raises(fl.errors.ArgumentError, match="a periodic load needs a period"):
        arm.to_control()
    plant, inertia = arm.to_control(period=0.5), value(arm, "M", np.zeros(1))[0, 0]
    found = [plant.dynamics(t, np.zeros(2), np.zeros(1))[1] for t in (0.0, 0.05, 0.625)]
    np.testing.assert_allclose(found, 0.4 / inertia * np.cos(8 * np.pi * np.array([0.0, 0.05, 0.625])), atol=1e-9)
