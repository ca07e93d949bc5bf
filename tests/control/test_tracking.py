"""Periodic motions of the elastic arm and feedforward: against the forced response, the residual and the prescribed joint; followed in
speed where Newton's method finds none from the rigid motion, and the reason told where that ends."""

import re

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.control import feedforward
from flexlin.control.tracking import KINDS, joints_exact, tip_exact, tip_positions
from flexlin.errors import ArgumentError, NumericalError, ToleranceNotReached
from flexlin.linearization import Solver, balance
from flexlin.linearization.periodic_motion import continue_in_speed, find_singular, linearize_about, periodic_motion
from tests.closed_arm import closed


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
    t = np.linspace(0, 2 * lin.period, 57)
    assert np.abs(periodic_motion(lin, linear=True).state(t) - response(t)).max() < 1e-8 * np.abs(response(t)).max()


@pytest.mark.parametrize("kind", KINDS)
def test_nonlinear_solution_obeys_the_equations_between_its_nodes(lin, kind):
    motion = feedforward(lin, kind).motion or periodic_motion(lin)
    assert motion.error < 1e-8
    assert residual_between_nodes(lin, motion) < 1e-8


def test_joint_exact_is_the_arm_with_its_joint_prescribed(lin):
    """An independent way: leave the joint out of the coordinates and take the links' forced response."""
    prescribed = closed(changes={"motion.drive": "prescribed", "designs": [], "control": {"feedforward": "rigid"}})
    response = fl.forced_response(prescribed.periodic_system(), prescribed.forcing, tol=1e-10)
    linear, t = periodic_motion(lin, closing=joints_exact, linear=True), np.linspace(0, lin.period, 33)
    assert np.abs(linear(t)[:, 0]).max() < 1e-12
    assert np.abs(linear(t)[:, 1:] - response(t)[:, :2]).max() < 1e-8 * np.abs(response(t)).max()


def across(lin, found):
    """The largest distance of the tip from the rigid link's line, in m."""
    t = np.linspace(0, lin.period, 101)
    at, rigid = tip_positions(lin, t, found.motion(t)), tip_positions(lin, t, np.zeros((len(t), lin.n)))
    return np.abs(at[:, 0] * rigid[:, 1] - at[:, 1] * rigid[:, 0]).max() / np.linalg.norm(rigid[0])


@pytest.mark.parametrize("name", ["single-link", pytest.param("de-luca-siciliano-1991", marks=pytest.mark.slow)])
def test_tip_exact_leaves_only_the_shortening_of_the_link(name):
    lin = closed(name)
    rigid, exact = feedforward(lin, "rigid"), feedforward(lin, "tip-exact")
    assert 20 * exact.tip_error < rigid.tip_error
    assert residual_between_nodes(lin, exact.motion) < 1e-7
    assert name != "single-link" or across(lin, exact) < 1e-10


def test_small_disturbances_of_the_nonlinear_loop_follow_the_linearization_about_it(lin):
    """Finite differences of the equations about the elastic motion, by the manipulator's own residual; bent links give damping terms."""
    motion, t = periodic_motion(lin), np.array([0.3, 0.9])
    M, D, K = linearize_about(motion, closed=False).second_order.sample(t)
    base, eps = np.array([motion(t), motion.rate(t), motion.acceleration(t)]), 1e-6
    for level, matrix in enumerate((K, D, M)):
        for column in range(lin.n):
            step = np.zeros_like(base)
            step[level, :, column] = eps
            sides = [lin.about.of_arm("residual", t, *(base + sign * step))[:, :, 0] for sign in (1, -1)]
            assert np.abs((sides[0] - sides[1]) / (2 * eps) - matrix[:, :, column]).max() < 1e-6 * np.abs(matrix).max()


def solver_of(name):
    lin = closed(name, {"designs": []})
    return lin, Solver(lin.about, balance(lin.about, tip_exact), lin.law.direct, 33)


def held_inertia(lin, t, y):
    """det of the elastic rows of M on the directions that keep every end on its line: what it divides by, written without the solver. The
    distances of the links' ends from their rigid lines have slopes (m, n) by differences of the arm's points."""

    def lines(values):
        points = [lin.about.of_arm("points", np.array([t]), one[None])[0] for one in (values, np.zeros(lin.n))]
        bent, rigid = (np.diff(one, axis=1) for one in points)
        return (rigid[0] * bent[1] - rigid[1] * bent[0]) / np.linalg.norm(rigid, axis=0)

    C = np.array([(lines(y + h) - lines(y - h)) / 2e-6 for h in 1e-6 * np.eye(lin.n)]).T
    M = lin.about.of_arm("M", np.array([t]), y[None])[0][np.ix_(lin.kept, lin.kept)]
    joint = np.array([c.kind == "joint" for c in lin.coordinates])
    kept = np.eye(lin.n)[:, ~joint]
    kept[joint] = -np.linalg.solve(C[:, joint], C[:, ~joint])
    return np.linalg.det(M[~joint] @ kept)


def test_a_motion_followed_from_rest_is_the_one_that_newtons_method_finds():
    lin, solver = solver_of("single-link")
    direct, followed = solver.solve(None)[0], continue_in_speed(solver)
    np.testing.assert_allclose(followed, direct, atol=1e-9 * np.abs(direct).max())
    residual = solver.residual(followed, 1.0)[0]
    assert np.abs(residual).max() < 1e-9 * np.abs(lin.sample(solver.given[0]).tau).max()


@pytest.mark.slow
def test_where_it_ends_the_error_names_the_speed_and_the_singular_inertia():
    """The speed at which the inertia becomes singular is one frequency, whatever the motion's own; at it, the sign changes by a formula
    that shares nothing with the solver."""
    found = {}
    for frequency in (0.4, 0.5):
        with pytest.raises(NumericalError, match=r"no periodic motion.*singular about t") as error:
            feedforward(closed("khang-2019", {"designs": [], "motion.frequency": frequency}), "tip-exact")
        found[frequency] = float(re.search(r"from ([\d.]+) of it on", str(error.value))[1])
    assert 0.4 * found[0.4] == pytest.approx(0.5 * found[0.5], rel=0.01)
    lin, solver = solver_of("khang-2019")
    z, t = solver.solve(None, 0.0)[0], solver.given[0]
    for share, changes in ((0.97, False), (1.03, True)):
        z = solver.solve(z, share * found[0.5])[0]
        signs = {np.sign(held_inertia(lin, now, y[: lin.n])) for now, y in zip(t, z, strict=True)}
        assert (len(signs) == 2) is changes is (solver.singular_time(z) is not None)
    slower = feedforward(closed("khang-2019", {"designs": [], "motion.frequency": 0.14}), "tip-exact")
    assert slower.error < 1e-8
    assert slower.status.startswith("converged")


def test_a_path_that_is_singular_at_rest_is_singular_at_any_speed():
    lin, solver = solver_of("pick-and-place")
    z = solver.solve(None, 0.0)[0]
    speed, t = find_singular(solver, [(0.0, z)])
    assert speed == 0.0
    k = int(np.flatnonzero(np.isclose(solver.given[0], t))[0])
    before, behind = (held_inertia(lin, solver.given[0][i], z[i, : lin.n]) for i in (k - 1, k))
    assert before * behind < 0


REFUSED = [
    ("single-link", "magic", ArgumentError, "no such feedforward"),
    ("spinning-link", "tip-exact", ArgumentError, "nothing to feed forward"),
    ("spatial-arm", "tip-exact", ArgumentError, "an arm in space"),
    pytest.param("pick-and-place", "tip-exact", ToleranceNotReached, "singular about t", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("name", "kind", "error", "words"), REFUSED)
def test_what_cannot_be_fed_forward_says_why(name, kind, error, words):
    with pytest.raises(error, match=words):
        feedforward(closed(name, {"designs": []}), kind)
