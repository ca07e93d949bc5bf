"""How many segments each value is computed on: pilots of a made-up kernel whose errors are known."""

import numpy as np

from flexlin.analyses.sweep.together import MOST_SEGMENTS, PILOT_VALUES, SEGMENT_NUMBERS, learn_needs
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
        periods, definite = np.full(len(points), PERIOD), np.full(len(points), True)
        return Logs(logs, np.stack([errors, errors / 3], axis=1), np.isfinite(errors), periods, definite)


def test_needs_are_learnt_from_values_all_over_the_plane():
    """Need by a power of a frequency over decades and an exponential of a second number."""
    rng = np.random.default_rng(3)
    points = np.stack([np.exp(rng.uniform(-3, 2, 5000)), rng.uniform(-1, 4, 5000)], axis=1)

    def need(p):
        return 30.0 * p[:, 0] ** -0.4 * np.exp(0.1 * p[:, 1])

    kernel = MadeUp(need)
    needs = learn_needs(kernel, points, np.ones(2), TOL)
    found = needs.predict(points)
    off = SEGMENT_NUMBERS[found] / need(points)
    assert np.mean(off < 1) < 0.05
    assert np.mean(off) < 1.6
    assert kernel.work <= 9 * need(points).max() * PILOT_VALUES[1] / WIDTH
    assert np.array_equal(needs.predict(points[::-1]), found[::-1])


def test_values_without_a_need_do_not_cost_the_others():
    """Half of the plane never meets tol: given up soon, and the other half is as well known."""

    def need(p):
        return np.where(p[:, 0] > 0, 20.0, np.inf)

    points = np.random.default_rng(1).uniform(-1, 1, (400, 1))
    kernel = MadeUp(need)
    needs = learn_needs(kernel, points, np.ones(2), TOL)
    assert np.all(SEGMENT_NUMBERS[needs.predict(points)] <= 23)
    assert needs.spread == 0.0
    assert kernel.work < 40 * 20 * PILOT_VALUES[0] / WIDTH
    nothing = learn_needs(MadeUp(lambda p: np.full(len(p), np.inf)), points, np.ones(2), TOL)
    assert np.all(SEGMENT_NUMBERS[nothing.predict(points)] == MOST_SEGMENTS)
