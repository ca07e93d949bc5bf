"""Boundary curves against closed forms: Meissner's equation with its trace, islands of known shape, and tips of tongues, points at which
two sides of the boundary meet."""

import numpy as np
import pytest
from scipy.optimize import brentq

import flexlin as fl
from flexlin.periodic import Effort, Spectra, find_curves, find_tip
from tests.periodic.boundary.test_crossings import find_changes, meissner, trace
from tests.thinned import thin


class Meissner:
    """Spectra over (a, q) in a range; counts what it is asked."""

    def __init__(self, damping, low=(0.3, 0.2), span=(8.7, 2.8)):
        self.damping, self.low, self.span, self.asked = damping, np.array(low), np.array(span), 0

    def __call__(self, unit):
        self.asked += len(unit)
        a, q = (self.low + self.span * unit).T
        return meissner(q, self.damping)(a)

    def distance(self, points, scale=1.0):
        """Distance of points (N, 2) of the unit square from the boundary by its trace, where the sides measure `scale`."""

        def excess(x):
            return np.abs(trace(*(self.low + self.span * x).T, self.damping)) - 2 * np.cosh(np.pi * self.damping)

        h = 1e-7
        gradient = [(excess(points + step) - excess(points - step)) / (2 * h) for step in h * np.eye(2) / scale]
        return np.abs(excess(points)) / np.hypot(*gradient)


PINCHES = np.array([[0.5, 1.5], [2.5, 1.5], [6.5, 2.5]])
"""Where two tongues of the undamped equation touch: both halves of the period are whole half-waves. The distance by one Newton step,
which the test takes for the truth, means nothing there."""


@pytest.mark.parametrize(("damping", "tol"), thin([(0.2, 1e-7), (0.05, 1e-7), (0.0, 1e-7), (0.02, 1e-8)]))
def test_meissners_boundary_is_met_everywhere_at_a_small_part_of_a_fine_grid(damping, tol):
    """No point is farther off than its error, nor a cubic whose middle lies on the boundary by chance; no part is left out: along lines
    that lie on no lattice line, each change of the exact verdict is near a curve."""
    family = Meissner(damping)
    curves = find_curves(family, tol)
    assert family.asked < 40_000  # 4 % of 1000 x 1000
    for curve in curves:
        between = (curve.points[1:] + curve.points[:-1]) / 2
        assert not damping or np.all(family.distance(curve.points) <= curve.errors)
        for points in (curve.points, between):
            places = (PINCHES - family.low) / family.span
            pinched = np.min(np.abs(points - places[:, None]).max(axis=2), axis=0) < 1e-4
            assert np.all(family.distance(points[~pinched], family.span) < 1e-6)
        assert curve.errors.max() < 1e-6
    line = np.linspace(0.001, 0.999, 20001)
    for place in (0.1234, 0.4321, 0.777, 0.9101):
        unit = np.stack([line, np.full(len(line), place)], axis=1)
        edges = find_changes(family(unit).verdicts > 0)
        assert measure_distance(unit[edges], curves).max() < 1e-4


def island(unit, centre, radius, sign=1.0, angle=0.0):
    """A real multiplier, or a pair at an angle, whose log falls with the distance from a centre, beside strongly damped ones."""
    growth = sign * (radius**2 - ((unit - centre) ** 2).sum(axis=1))
    pair = [growth + 1j * angle, growth - 1j * angle] if angle else [growth + 0j]
    logs = np.stack([*pair, np.full(len(unit), -3.0 + 0j)], axis=1)
    return Spectra(logs, np.full(logs.shape, 1e-13))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("radius", "angle"), [(0.3, 0.0), (0.004, 0.0), (0.3, 0.9)])
def test_islands_and_holes_are_closed_with_the_unstable_side_on_the_left(radius, angle, sign):
    """The small one lies between the points of the lattice; the last one is a pair that leaves the circle with no other near."""
    centre = np.array([0.513, 0.487])
    (curve,) = find_curves(lambda unit: island(unit, centre, radius, sign, angle), 1e-8, cells=16)
    assert curve.closed
    assert np.allclose(np.linalg.norm(curve.points - centre, axis=1), radius, rtol=0, atol=1e-8)
    (x, y), (dx, dy) = (curve.points[:-1] - centre).T, np.diff(curve.points, axis=0).T
    assert np.all(sign * (x * dy - y * dx) > 0)
    length = np.linalg.norm(np.diff(curve.points, axis=0), axis=1).sum()
    assert length == pytest.approx(2 * np.pi * radius, rel=1e-4)


def test_a_boundary_through_a_corner_of_the_range_and_none_at_all():
    def plane(unit):
        logs = np.stack([unit[:, 0] - unit[:, 1], np.full(len(unit), -2.0)], axis=1) + 0j
        return Spectra(logs, np.full(logs.shape, 1e-13))

    (curve,) = find_curves(plane, 1e-9, cells=5)
    np.testing.assert_allclose(sorted(curve.points[[0, -1], 0]), [0.0, 1.0], atol=1e-8)
    np.testing.assert_allclose(curve.points[:, 0], curve.points[:, 1], atol=1e-8)
    assert find_curves(lambda unit: island(unit, np.array([3.0, 3.0]), 1.0), 1e-6, cells=4) == []


def test_a_peak_that_is_no_island_adds_no_line():
    """Four states whose growth rate peaks at a lattice point beside nothing unstable: the square that climbs it adds no value."""
    mean, swing = np.array([[2.0, 0.1], [0.1, 5.0]]), np.array([[0.3, 0.2], [0.2, -0.1]])

    def oscillators(p, q):
        def stiffness(t):
            return mean + q * swing * np.cos(p * t)[:, None, None]

        return fl.PeriodicSystem.from_second_order(np.eye(2), 0.5 * np.eye(2), stiffness, 2 * np.pi / p)

    ranges = {"p": (0.8, 6.0), "q": (0.05, 3.0)}
    assert isinstance(fl.stability_boundary(oscillators, ranges, tol=1e-2, cells=6), list)


@pytest.mark.parametrize("apart", [1e-5, -1e-5])
def test_sides_that_part_or_a_neck_that_stays_open_are_no_tip(apart):
    """Of an undamped pair at angle 0, by the square of its growth with a rounding of 1e-12."""

    def function(unit):
        u, v = (unit - [0.5003, 0.4991]).T
        root = np.sqrt(900 * (u * v + apart * abs(apart)) + 0j)
        error = np.broadcast_to(1e-12 / np.maximum(np.abs(root), 1e-6), (2, len(unit))).T
        return Spectra(np.stack([root, -root], axis=1), error)

    low = np.array([0.4995, 0.4985])
    assert find_tip(low, low + 0.001, np.zeros(1), np.array([True]), function, 1e-7) is None


def sides(a, q):
    """Four functions (4, V) that vanish on the sides of Meissner's tongues: solutions even or odd about the middles of both halves, with
    the period or twice that long."""
    w1, w2 = np.sqrt(a + q + 0j), np.sqrt(a - q + 0j)
    c1, c2, s1, s2 = np.cos(w1 * np.pi / 2), np.cos(w2 * np.pi / 2), np.sin(w1 * np.pi / 2), np.sin(w2 * np.pi / 2)
    even, odd = w1 * s1 * c2 + w2 * s2 * c1, s1 / w1 * c2 + s2 / w2 * c1
    return np.stack([even, odd, c1 * c2 - w1 * s1 * s2 / w2, c1 * c2 - w2 * s2 * s1 / w1]).real


def beside_sides(family, curves):
    """Distance (N,) of the points of curves of the undamped equation from those sides, by a Newton step, in units of a and q."""
    (a, q), h = (family.low + family.span * np.concatenate([curve.points for curve in curves])).T, 1e-6
    slopes = np.hypot(sides(a + h, q) - sides(a - h, q), sides(a, q + h) - sides(a, q - h)) / (2 * h)
    return np.min(np.abs(sides(a, q)) / slopes, axis=0)


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
def test_meissners_tongues_are_followed_into_their_tips(lowest):
    """Without damping tongues close at q = 0, and inside the range where both halves of the period are whole half-waves."""
    family = Meissner(0.0, (0.3, lowest), (3.5, 2.0))
    curves = find_curves(family, 1e-7)
    assert family.asked < 40_000  # 4 % of 1000 x 1000
    assert beside_sides(family, curves).max() < 1e-6
    rng, grid, exact = np.random.default_rng(0), np.linspace(0.3, 3.8, 2001), []
    near = 10 ** rng.uniform(-6, -1, 12)
    for q in (*rng.uniform(lowest, lowest + 2.0, 12), *(1.5 + near[:6]), *(1.5 - near[6:]), *(lowest + near)):
        values = sides(grid, q)
        for side, k in zip(*np.nonzero(values[:, 1:] * values[:, :-1] < 0), strict=True):
            root = brentq(lambda a, side=side, q=q: sides(np.array([a]), q)[side, 0], grid[k], grid[k + 1], xtol=1e-14)
            exact.append((root, q))
    assert len(exact) > 100
    assert measure_distance((np.array(exact) - family.low) / family.span, curves).max() * 3.5 < 1e-6


def test_an_effort_that_ends_leaves_tips_open_and_knows_it():
    """What is handed back lies on the boundary all the same."""
    effort, family = Effort(0.0), Meissner(0.0, span=(3.5, 2.0))
    curves = find_curves(family, 1e-5, cells=16, effort=effort)
    assert effort.unfinished
    assert (family(np.array([one.inside for one in curves])).verdicts > 0).all()
    assert np.all(beside_sides(family, curves) <= 3.5 * np.concatenate([one.errors for one in curves]))
