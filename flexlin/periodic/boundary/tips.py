"""Tips of tongues, where both sides of the boundary meet: in a box so small that the margin is a polynomial there."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from flexlin.checks import Array
from flexlin.periodic.boundary.follow import EXACT
from flexlin.periodic.boundary.lattice import spread
from flexlin.periodic.boundary.spectra import SpectraFunction, measure_margins
from flexlin.periodic.chebyshev import chebyshev_nodes
from flexlin.periodic.precision import CUBE
from flexlin.periodic.resolved.panels import NODES

DEGREE = 5
"""Of the polynomials through the margin on a box, along either side."""


@dataclass(frozen=True)
class Tip:
    """Where two sides of the boundary meet, (2,), how far from it they may part, and whether the margin there is zero but for rounding."""

    point: Array
    error: float
    zero: bool


def find_tip(
    low: Array, high: Array, angle: Array, undamped: Array, function: SpectraFunction, tol: float
) -> Tip | None:
    """The point of a box at which two sides of the boundary meet to within tol, or to within rounding, if there is one.

        m = 0,  grad m = 0,   or on a border of the unit square  m = 0,  dm/ds = 0   along it

    m: the margin, smooth through the boundary (`measure_margins`), as a polynomial of both coordinates, each from -1 to 1 in the box.
    There the sides part like (2 |m| / |largest eigenvalue of m''|)^(1/2). Borders come first: a flat cusp is critical all along its
    last part.
    Parameters: low, high (2,): of the box; angle, undamped (1,): of the margin.
    Source: Seyranian, Mailybaev, Multiparameter Stability Theory (2003), section 2.9 (singularities of stability boundaries).
    """
    nodes = spread(*2 * [chebyshev.chebpts1(DEGREE + 1)])
    places, count = (low + high) / 2 + nodes * (high - low) / 2, len(nodes)
    values, errors = measure_margins(function(places), np.repeat(undamped, count), np.repeat(angle, count))
    if not (np.isfinite(values).all() and np.isfinite(errors).all()):
        return None
    margin = np.linalg.solve(chebyshev.chebvander2d(nodes[:, 0], nodes[:, 1], [DEGREE, DEGREE]), values).reshape(
        DEGREE + 1, DEGREE + 1
    )
    tail, rounding = float(np.abs(margin[-1]).sum() + np.abs(margin[:, -1]).sum()), float(np.median(errors))
    borders = [(axis, end) for axis in range(2) for end, at in ((-1, low[axis] <= 0), (1, high[axis] >= 1)) if at]
    for sides in (borders, [None]):
        close = []
        for side in sides:
            point, bend = find_critical(margin, side)
            if np.abs(point).max() <= 1 + CUBE and bend > 0:
                left = abs(float(value_of(margin, point)))
                apart = np.sqrt(2 * (left + rounding + tail) / bend) * (high - low).max() / 2
                place = np.clip((low + high) / 2 + point * (high - low) / 2, 0.0, 1.0)
                close.append(Tip(place, float(apart), left + tail <= EXACT * rounding))
        close = [tip for tip in close if tip.zero or tip.error <= tol]
        if close:
            return min(close, key=lambda tip: tip.error)
    return None


def find_critical(margin: Array, side: tuple[int, int] | None) -> tuple[Array, float]:
    """The critical point of a polynomial in its box, or along one side of it, axis `side[0]` at `side[1]`, by Newton's method from the
    flattest point of a grid; and its largest second derivative there."""
    free = [axis for axis in range(2) if side is None or axis != side[0]]
    slopes = [chebyshev.chebder(margin, axis=axis) for axis in range(2)]
    bends = [[chebyshev.chebder(slope, axis=axis) for axis in range(2)] for slope in slopes]
    grid = chebyshev_nodes(NODES)
    points = spread(*(grid if axis in free or side is None else np.array([float(side[1])]) for axis in range(2)))
    steep = np.hypot.reduce([value_of(slopes[axis], points) for axis in free])
    point, hessian = points[steep.argmin()].copy(), np.zeros((len(free), len(free)))
    for _ in range(NODES):
        gradient = np.array([value_of(slopes[axis], point) for axis in free])
        hessian = np.array([[value_of(bends[i][j], point) for i in free] for j in free])
        point[free] = np.clip(point[free] + np.linalg.lstsq(hessian, -gradient, rcond=CUBE)[0], -2.0, 2.0)
    return point, float(np.abs(np.linalg.eigvalsh(hessian)).max())


def value_of(polynomial: Array, points: Array) -> Array:
    """A polynomial of both coordinates at points (..., 2)."""
    return np.asarray(chebyshev.chebval2d(points[..., 0], points[..., 1], polynomial))
