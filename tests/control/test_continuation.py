"""Exact feedforward where Newton's method finds none from the rigid motion: followed in speed, and the reason told where that ends."""

import re

import numpy as np
import pytest

from flexlin.control import feedforward
from flexlin.control.tracking import tip_exact
from flexlin.errors import NumericalError, ToleranceNotReached
from flexlin.linearization import Solver, balance
from flexlin.linearization.periodic_motion import continue_in_speed, find_singular
from tests.closed_arm import closed


def solver_of(name):
    lin = closed(name, {"designs": []})
    return lin, Solver(lin.about, balance(lin.about, tip_exact), lin.law.direct, 33)


def slopes_of_lines(lin, t, y):
    """Slopes (m, n) of the distances of the links' ends from their rigid lines, by differences of the arm's points."""

    def lines(values):
        points = [lin.about.of_arm("points", np.array([t]), one[None])[0] for one in (values, np.zeros(lin.n))]
        bent, rigid = (np.diff(one, axis=1) for one in points)
        return (rigid[0] * bent[1] - rigid[1] * bent[0]) / np.linalg.norm(rigid, axis=0)

    return np.array([(lines(y + h) - lines(y - h)) / 2e-6 for h in 1e-6 * np.eye(lin.n)]).T


def held_inertia(lin, t, y):
    """det of the elastic rows of M on the directions that keep every end on its line: what it divides by, written without the solver."""
    M = lin.about.of_arm("M", np.array([t]), y[None])[0][np.ix_(lin.kept, lin.kept)]
    joints = [i for i, c in enumerate(lin.coordinates) if c.kind == "joint"]
    elastic = [i for i in range(lin.n) if i not in joints]
    C = slopes_of_lines(lin, t, y)
    kept = np.zeros((lin.n, len(elastic)))
    kept[elastic] = np.eye(len(elastic))
    kept[joints] = -np.linalg.solve(C[:, joints], C[:, elastic])
    return np.linalg.det(M[elastic] @ kept)


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
        with pytest.raises(NumericalError, match="no periodic motion") as error:
            feedforward(closed("khang-2019", {"designs": [], "motion.frequency": frequency}), "tip-exact")
        found[frequency] = float(re.search(r"from ([\d.]+) of it on", str(error.value))[1])
        assert "singular about t" in str(error.value)
    assert 0.4 * found[0.4] == pytest.approx(0.5 * found[0.5], rel=0.01)
    lin, solver = solver_of("khang-2019")
    z = solver.solve(None, 0.0)[0]
    for share, changes in ((0.97, False), (1.03, True)):
        z = solver.solve(z, share * found[0.5])[0]
        t = solver.given[0]
        signs = {np.sign(held_inertia(lin, now, y[: lin.n])) for now, y in zip(t, z, strict=True)}
        assert (len(signs) == 2) is changes is (solver.singular_time(z) is not None)


def test_a_slower_motion_of_the_same_arm_is_found():
    made = feedforward(closed("khang-2019", {"designs": [], "motion.frequency": 0.14}), "tip-exact")
    assert made.error < 1e-8
    assert made.status.startswith("converged")


def test_a_path_that_is_singular_at_rest_is_singular_at_any_speed():
    lin, solver = solver_of("pick-and-place")
    z = solver.solve(None, 0.0)[0]
    speed, t = find_singular(solver, [(0.0, z)])
    assert speed == 0.0
    k = int(np.flatnonzero(np.isclose(solver.given[0], t))[0])
    before, behind = (held_inertia(lin, solver.given[0][i], z[i, : lin.n]) for i in (k - 1, k))
    assert before * behind < 0


@pytest.mark.slow
def test_pick_and_place_says_why_it_is_not_resolved():
    with pytest.raises(ToleranceNotReached, match="singular about t"):
        feedforward(closed("pick-and-place", {"designs": []}), "tip-exact")
