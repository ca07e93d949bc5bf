"""How many segments each value is computed on: pilots of a made-up kernel whose errors are known, and the vectors made of values."""

import numpy as np
import pytest

from flexlin.answers.sweep.together import MARGIN, MOST, PILOTS, STARTS, find_rungs, learn_needs, pack, try_pilots
from flexlin.periodic.many import WIDTH, Logs

TOL, PERIOD = 1e-8, 3.0
"""Errors may be as large as tol times the period, which is longer than the logs are large."""


class MadeUp:
    """Errors of order 8, just met on `need(points)` segments; work counted in vectors times segments. Values without a need never meet."""

    def __init__(self, need):
        self.need, self.work = need, 0

    def find_logs(self, points, segments, scale, accuracy, spread, tol, levels):
        self.work += segments * -(-len(points) // WIDTH)
        errors = PERIOD * TOL * (self.need(points) / segments) ** 8
        logs = np.stack([np.full(len(points), -1.0 + 2j), np.full(len(points), -1.0 - 2j)], axis=1)
        periods, work = np.full(len(points), PERIOD), np.full(len(points), segments)
        return Logs(logs, np.stack([errors, errors / 3], axis=1), np.isfinite(errors), periods, work)


@pytest.mark.parametrize("count", [1, 7, 8, 61, 1000])
def test_every_value_is_in_one_vector_and_has_what_it_wants(count):
    wanted = np.random.default_rng(count).uniform(1.0, 900.0, count)
    parts = list(pack(find_rungs(wanted)))
    assert np.array_equal(np.sort(np.concatenate([which for _, which in parts])), np.arange(count))
    assert [segments for segments, _ in parts] == sorted({segments for segments, _ in parts})
    assert all(np.all(wanted[which] <= segments * (1 + 1e-8)) for segments, which in parts)
    assert all(len(which) % WIDTH == 0 for _, which in parts[:-1])
    ideal = np.array(STARTS)[np.searchsorted(STARTS, wanted)].sum()
    assert sum(segments * len(which) for segments, which in parts) <= ideal + WIDTH * STARTS[-1]


def test_needs_are_learnt_from_values_all_over_the_plane():
    """Need by a power of a frequency over decades and an exponential of a second number."""
    rng = np.random.default_rng(3)
    points = np.stack([np.exp(rng.uniform(-3, 2, 5000)), rng.uniform(-1, 4, 5000)], axis=1)

    def need(p):
        return 30.0 * p[:, 0] ** -0.4 * np.exp(0.1 * p[:, 1])

    kernel = MadeUp(need)
    needs = learn_needs(kernel, points, np.ones(2), TOL)
    found = needs.predict(points)
    off = STARTS[found] / need(points)
    assert np.mean(off < 1) < 0.05
    assert np.mean(off) < 1.6
    assert kernel.work <= 9 * need(points).max() * PILOTS[1] / WIDTH
    assert np.array_equal(needs.predict(points[::-1]), found[::-1])


def test_values_without_a_need_do_not_cost_the_others():
    """Half of the plane never meets tol: given up soon, and the other half is as well known."""

    def need(p):
        return np.where(p[:, 0] > 0, 20.0, np.inf)

    points = np.random.default_rng(1).uniform(-1, 1, (400, 1))
    kernel = MadeUp(need)
    tried, spread = try_pilots(kernel, points[: PILOTS[1]], np.ones(2), TOL)
    met = points[: PILOTS[1], 0] > 0
    assert np.isfinite(tried[met]).all()
    assert np.isinf(tried[~met]).all()
    assert spread == 0.0
    assert kernel.work < 40 * 20 * PILOTS[1] / WIDTH
    needs = learn_needs(kernel, points, np.ones(2), TOL)
    assert np.all(STARTS[needs.predict(points)] <= 23)
    nothing = learn_needs(MadeUp(lambda p: np.full(len(p), np.inf)), points, np.ones(2), TOL)
    assert np.all(STARTS[nothing.predict(points)] == MOST)


def test_needs_of_two_kinds_cost_no_more_than_the_larger_one_for_all():
    """A need that no polynomial follows: three times as much in every other stripe."""

    def need(p):
        return np.where(np.sin(100 * p[:, 0]) > 0, 60.0, 20.0)

    points = np.random.default_rng(5).uniform(-1, 1, (3000, 2))
    predicted = STARTS[learn_needs(MadeUp(need), points, np.ones(2), TOL).predict(points)]
    missed = predicted < need(points)
    assert np.mean(predicted + np.where(missed, 1.5 * need(points), 0.0)) < 1.2 * MARGIN * 60
    assert missed.mean() < 0.6
