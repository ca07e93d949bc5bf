"""Boundary curves against closed forms: Meissner's equation with its trace, and islands of known shape."""

import numpy as np
import pytest

from flexlin.periodic import Spectra, find_curves
from tests.thinned import thin

LOW, SPAN = np.array([0.3, 0.2]), np.array([8.7, 2.8])


def halves(a, q, damping):
    """Cosines and sines of both halves of the period, each pi long: y'' + d y' + (a +- q) y = 0."""
    roots = [np.sqrt(a + sign * q - damping**2 / 4 + 0j) for sign in (1.0, -1.0)]
    return [(np.cos(np.pi * w).real, (np.sin(np.pi * w) / w).real) for w in roots]


class Meissner:
    """Spectra over (a, q) by the product of two exact transition matrices; counts what it is asked."""

    def __init__(self, damping):
        self.damping, self.asked = damping, 0

    def __call__(self, unit):
        self.asked += len(unit)
        (a, q), d = (LOW + SPAN * unit).T, self.damping
        product = np.eye(2)
        for (c, s), sign in zip(halves(a, q, d), (1.0, -1.0), strict=True):
            matrix = np.array([[c + d / 2 * s, s], [-(a + sign * q) * s, c - d / 2 * s]])
            product = np.exp(-np.pi * d / 2) * np.moveaxis(matrix, 2, 0) @ product
        multipliers = np.linalg.eigvals(product).astype(complex)
        gap = np.abs(multipliers[:, :1] - multipliers[:, 1:])
        error = 3e-12 + 3e-12 / np.maximum(gap, 2e-6)
        return Spectra(np.log(multipliers), np.repeat(error, 2, axis=1))

    def distance(self, points, scale=SPAN):
        """Distance of points (N, 2) of the unit square from the boundary |trace| = 2 cosh(pi d), where the sides measure `scale`."""

        def excess(x):
            (a, q), d = (LOW + SPAN * x).T, self.damping
            (c1, s1), (c2, s2) = halves(a, q, d)
            shift = a - d * d / 4
            return np.abs(2 * c1 * c2 - 2 * shift * s1 * s2) - 2 * np.cosh(np.pi * d)

        h = 1e-7
        steps = [np.array([h, 0.0]) / scale, np.array([0.0, h]) / scale]
        gradient = [(excess(points + step) - excess(points - step)) / (2 * h) for step in steps]
        return np.abs(excess(points)) / np.hypot(*gradient)


@pytest.mark.parametrize("damping", thin([0.05, 0.0, 0.2]))
def test_meissners_boundary_is_met_everywhere_at_a_small_part_of_a_fine_grid(damping):
    family = Meissner(damping)
    curves = find_curves(family, 1e-7)
    assert family.asked < 40_000  # 4 % of 1000 x 1000
    for curve in curves:
        between = (curve.points[1:] + curve.points[:-1]) / 2
        for points in (curve.points, between):
            pinched = np.min(np.abs(points - ((PINCHES - LOW) / SPAN)[:, None]).max(axis=2), axis=0) < 1e-4
            assert np.all(family.distance(points[~pinched]) < 1e-6)
        assert curve.errors.max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(("damping", "tol"), [(0.2, 1e-7), (0.02, 1e-8)])
def test_no_point_is_farther_off_than_its_error(damping, tol):
    """Nor in the first and last quarter of a cubic whose middle lies on the boundary by chance."""
    family = Meissner(damping)
    for curve in find_curves(family, tol):
        assert np.all(family.distance(curve.points, np.ones(2)) <= curve.errors)


PINCHES = np.array([[0.5, 1.5], [2.5, 1.5], [6.5, 2.5]])
"""Where two tongues of the undamped equation touch: both halves of the period are whole half-waves. The distance by one Newton step,
which the test takes for the truth, means nothing there."""


@pytest.mark.parametrize("damping", thin([0.2, 0.0]))
def test_no_part_of_meissners_boundary_is_left_out(damping):
    """Along lines that lie on no lattice line, each crossing of the exact boundary is near a curve."""
    family = Meissner(damping)
    curves = find_curves(family, 1e-6, cells=24)
    line, missed = np.linspace(0.001, 0.999, 20001), 0
    for place in (0.1234, 0.4321, 0.777, 0.9101):
        unit = np.stack([line, np.full(len(line), place)], axis=1)
        unstable = family(unit).verdicts > 0
        for x in line[np.flatnonzero(unstable[1:] != unstable[:-1])]:
            near = min(np.abs(curve.points - (x, place)).max(axis=1).min() for curve in curves)
            missed += near > 0.01
    assert missed == 0


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
        growth = unit[:, 0] - unit[:, 1]
        return Spectra(np.stack([growth + 0j, np.full(len(unit), -2.0 + 0j)], axis=1), np.full((len(unit), 2), 1e-13))

    (curve,) = find_curves(plane, 1e-9, cells=5)
    assert np.allclose(curve.points[[0, -1]], [[1.0, 1.0], [0.0, 0.0]], atol=1e-8) or np.allclose(
        curve.points[[0, -1]], [[0.0, 0.0], [1.0, 1.0]], atol=1e-8
    )
    assert find_curves(lambda unit: island(unit, np.array([3.0, 3.0]), 1.0), 1e-6, cells=4) == []


def test_a_peak_that_is_no_island_adds_no_line():
    """Four states whose growth rate peaks at a lattice point beside nothing unstable: the square that climbs it adds no value."""
    import flexlin as fl

    def oscillators(p, q):
        def stiffness(t):
            return (
                np.array([[2.0, 0.1], [0.1, 5.0]])
                + q * np.array([[0.3, 0.2], [0.2, -0.1]]) * np.cos(p * t)[:, None, None]
            )

        return fl.PeriodicSystem.from_second_order(np.eye(2), 0.5 * np.eye(2), stiffness, 2 * np.pi / p)

    ranges = {"p": (0.8, 6.0), "q": (0.05, 3.0)}
    assert isinstance(fl.stability_boundary(oscillators, ranges, tol=1e-2, cells=6), list)
