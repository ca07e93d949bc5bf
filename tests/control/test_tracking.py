"""Periodic motions of the elastic arm and feedforward: against the forced response, the residual and the prescribed joint."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.control import feedforward
from flexlin.control.tracking import KINDS, tip_positions
from flexlin.errors import ArgumentError
from flexlin.linearization.periodic_motion import linearize_about, periodic_motion
from tests.closed_arm import closed

BARE = {"control": {"feedforward": "rigid"}}


@pytest.fixture(scope="module")
def lin():
    return closed()


def residual_between_nodes(lin, motion):
    """The left side of the equations of motion minus the torque, at random times; uses the manipulator's own functions."""
    t = np.random.default_rng(2).uniform(0, lin.period, 40)
    left = lin.about.of_arm("residual", t, motion(t), motion.rate(t), motion.acceleration(t))[:, :, 0]
    B = np.array(ca.evalf(lin.arm.B[:, list(lin.driven)]))
    return np.abs(left - motion.torque(t) @ B.T).max() / np.abs(motion.torque(t)).max()


def test_first_newton_step_is_the_forced_response_of_the_linear_model(lin):
    response = fl.forced_response(lin.periodic_system(), lin.forcing, tol=1e-10)
    linear = periodic_motion(lin, linear=True)
    t = np.linspace(0, 2 * lin.period, 57)
    assert np.abs(linear.state(t) - response(t)).max() < 1e-8 * np.abs(response(t)).max()


@pytest.mark.parametrize("kind", KINDS)
def test_nonlinear_solution_obeys_the_equations_between_its_nodes(lin, kind):
    found = feedforward(lin, kind)
    motion = found.motion or periodic_motion(lin)
    assert motion.error < 1e-8
    assert residual_between_nodes(lin, motion) < 1e-8


def test_joint_exact_is_the_arm_with_its_joint_prescribed(lin):
    """An independent way: leave the joint out of the coordinates and take the links' forced response."""
    prescribed = closed(changes={"motion.drive": "prescribed", "designs": []} | BARE)
    response = fl.forced_response(prescribed.periodic_system(), prescribed.forcing, tol=1e-10)
    linear = periodic_motion(lin, closing=fl.control.tracking.joints_exact, linear=True)
    t = np.linspace(0, lin.period, 33)
    assert np.abs(linear(t)[:, 0]).max() < 1e-12
    assert np.abs(linear(t)[:, 1:] - response(t)[:, :2]).max() < 1e-8 * np.abs(response(t)).max()


def across(lin, found):
    """The largest distance of the tip from the rigid link's line, in m."""
    t = np.linspace(0, lin.period, 101)
    at, rigid = tip_positions(lin, t, found.motion(t)), tip_positions(lin, t, np.zeros((len(t), lin.n)))
    return np.abs(at[:, 0] * rigid[:, 1] - at[:, 1] * rigid[:, 0]).max() / np.linalg.norm(rigid[0])


def test_tip_exact_leaves_only_the_shortening_of_the_link(lin):
    rigid, exact = feedforward(lin, "rigid"), feedforward(lin, "tip-exact")
    assert 20 * exact.tip_error < rigid.tip_error
    assert across(lin, exact) < 1e-10


@pytest.mark.slow
def test_two_links_reach_their_tips():
    two = closed("de-luca-siciliano-1991")
    rigid, exact = feedforward(two, "rigid"), feedforward(two, "tip-exact")
    assert residual_between_nodes(two, exact.motion) < 1e-7
    assert 20 * exact.tip_error < rigid.tip_error


@pytest.mark.slow
def test_linearization_about_the_elastic_motion(lin):
    """At a hundredth of the amplitude and without gravity both basic motions give one verdict; bent links give damping terms."""
    calm = closed(changes={"motion.joints": [{"mean": 0.0, "amplitude": 0.005}], "effects.gravity": None})
    rigid, elastic = calm.periodic_system(), linearize_about(periodic_motion(calm))
    a, b = (fl.floquet(system, tol=1e-8) for system in (rigid, elastic))
    assert np.abs(a.exponents.real - b.exponents.real).max() < 1e-3 * np.abs(a.exponents.real).max()
    t = np.linspace(0, 1, 5)
    bent = linearize_about(periodic_motion(lin), closed=False).second_order
    assert np.abs(bent.sample(t)[1][:, 0, 1:]).max() > 1e-3
    assert np.abs(lin.D(t)[:, 0, 1:]).max() < 1e-14


def test_small_disturbances_of_the_nonlinear_loop_follow_the_linearization_about_it(lin):
    """Finite differences of the equations about the elastic motion, by the manipulator's own residual."""
    motion = periodic_motion(lin)
    system = linearize_about(motion, closed=False)
    t = np.array([0.3, 0.9])
    M, D, K = system.second_order.sample(t)
    base, eps = np.array([motion(t), motion.rate(t), motion.acceleration(t)]), 1e-6
    for level, matrix in enumerate((K, D, M)):
        for column in range(lin.n):
            step = np.zeros_like(base)
            step[level, :, column] = eps
            sides = [lin.about.of_arm("residual", t, *(base + sign * step))[:, :, 0] for sign in (1, -1)]
            assert np.abs((sides[0] - sides[1]) / (2 * eps) - matrix[:, :, column]).max() < 1e-6 * np.abs(matrix).max()


def test_refusals(lin):
    with pytest.raises(ArgumentError, match="no such feedforward"):
        feedforward(lin, "magic")
    with pytest.raises(ArgumentError, match="nothing to feed forward"):
        feedforward(closed("spinning-link"), "tip-exact")
