"""Tips of tongues: points at which two sides of the boundary meet, against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

from flexlin.periodic import Effort, Spectra, find_curves, find_tip
from tests.periodic.boundary import test_curves as meissner

CENTRE = np.array([0.5003, 0.4991])


def locked(squared):
    """Spectra of an undamped pair at angle 0 by the square of its growth, with rounding of 1e-12 in that."""

    def function(unit):
        D = squared(*unit.T)
        root = np.sqrt(D + 0j)
        error = np.broadcast_to(1e-12 / np.maximum(np.abs(root), 1e-6), (2, len(unit))).T
        return Spectra(np.stack([root, -root], axis=1), error)

    return function


def tip_of(squared, y):
    """The tip in a box of a thousandth of the range that begins at y."""
    low = np.array([0.4995, y])
    return find_tip(low, low + 0.001, np.zeros(1), np.array([True]), locked(squared), 1e-7)


@pytest.mark.parametrize("skew", [0.0, 0.6, -2.0])
def test_the_crossing_of_two_sides_inside_a_box_is_a_tip(skew):
    def squared(x, y):
        u, v = x - CENTRE[0], y - CENTRE[1]
        return 900 * (u - skew * v) * (v + 0.3 * u) * (1 + u)

    tip = tip_of(squared, 0.4985)
    assert tip is not None
    assert np.abs(tip.point - CENTRE).max() < 1e-8
    assert tip.error < 1e-6


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_tongue_that_closes_on_the_border_of_the_range_ends_there(order):
    def squared(x, y):
        return 400 * ((2 * y) ** (2 * order) - (x - CENTRE[0] - 0.7 * y) ** 2)

    tip = tip_of(squared, 0.0)
    assert tip is not None
    assert np.abs(tip.point - (CENTRE[0], 0.0)).max() < 1e-8


@pytest.mark.parametrize("apart", [1e-5, -1e-5])
def test_sides_that_part_or_a_neck_that_stays_open_are_no_tip(apart):
    def squared(x, y):
        u, v = x - CENTRE[0], y - CENTRE[1]
        return 900 * (u * v + apart * abs(apart))

    assert tip_of(squared, 0.4985) is None


def sides(a, q):
    """Four functions (4, V) that vanish on the sides of Meissner's tongues: solutions even or odd about the middles of both halves, with
    the period or twice that long."""
    w1, w2 = np.sqrt(a + q + 0j), np.sqrt(a - q + 0j)
    c1, c2, s1, s2 = np.cos(w1 * np.pi / 2), np.cos(w2 * np.pi / 2), np.sin(w1 * np.pi / 2), np.sin(w2 * np.pi / 2)
    even, odd = w1 * s1 * c2 + w2 * s2 * c1, s1 / w1 * c2 + s2 / w2 * c1
    return np.stack([even, odd, c1 * c2 - w1 * s1 * s2 / w2, c1 * c2 - w2 * s2 * s1 / w1]).real


def measure_distance(points, curves):
    """Distance (N,) of points from the nearest curve."""
    best = np.full(len(points), np.inf)
    for curve in curves:
        first, chord = curve.points[:-1], np.diff(curve.points, axis=0)
        length = np.maximum((chord**2).sum(axis=1), 1e-300)
        for i, point in enumerate(points):
            share = np.clip(((point - first) * chord).sum(axis=1) / length, 0, 1)
            best[i] = min(best[i], np.linalg.norm(first + share[:, None] * chord - point, axis=1).min())
    return best


@pytest.mark.slow
@pytest.mark.parametrize("lowest", [0.2, 1e-12])
def test_meissners_tongues_are_followed_into_their_tips(monkeypatch, lowest):
    """Without damping tongues close at q = 0, and inside the range where both halves of the period are whole half-waves."""
    low, span = np.array([0.3, lowest]), np.array([3.5, 2.0])
    monkeypatch.setattr(meissner, "LOW", low)
    monkeypatch.setattr(meissner, "SPAN", span)
    family = meissner.Meissner(0.0)
    curves = find_curves(family, 1e-7)
    assert family.asked < 40_000  # 4 % of 1000 x 1000
    (a, q), h = (low + span * np.concatenate([curve.points for curve in curves])).T, 1e-6
    slopes = np.hypot(sides(a + h, q) - sides(a - h, q), sides(a, q + h) - sides(a, q - h)) / (2 * h)
    assert np.min(np.abs(sides(a, q)) / slopes, axis=0).max() < 1e-6
    rng, grid = np.random.default_rng(0), np.linspace(low[0], low[0] + span[0], 2001)
    near = 10 ** rng.uniform(-6, -1, 12)
    exact = []
    for q in (*rng.uniform(low[1], low[1] + span[1], 12), *(1.5 + near[:6]), *(1.5 - near[6:]), *(lowest + near)):
        values = sides(grid, q)
        for side, k in zip(*np.nonzero(values[:, 1:] * values[:, :-1] < 0), strict=True):
            root = brentq(lambda a, side=side, q=q: sides(np.array([a]), q)[side, 0], grid[k], grid[k + 1], xtol=1e-14)
            exact.append((root, q))
    assert len(exact) > 100
    assert measure_distance((np.array(exact) - low) / span, curves).max() * span.max() < 1e-6


def test_an_effort_that_ends_leaves_tips_open_and_knows_it(monkeypatch):
    """What is handed back lies on the boundary all the same."""
    monkeypatch.setattr(meissner, "LOW", np.array([0.3, 0.2]))
    monkeypatch.setattr(meissner, "SPAN", np.array([3.5, 2.0]))
    effort, family = Effort(0.0), meissner.Meissner(0.0)
    curves = find_curves(family, 1e-5, cells=16, effort=effort)
    assert effort.unfinished
    assert (family(np.array([one.inside for one in curves])).verdicts > 0).all()
    a, q = (meissner.LOW + meissner.SPAN * np.concatenate([one.points for one in curves])).T
    h = 1e-6
    slopes = np.hypot(sides(a + h, q) - sides(a - h, q), sides(a, q + h) - sides(a, q - h)) / (2 * h)
    off = np.min(np.abs(sides(a, q)) / slopes, axis=0)
    assert np.all(off <= meissner.SPAN.max() * np.concatenate([one.errors for one in curves]))
