"""Tips of tongues, where both sides of the boundary meet: in a box so small that the margin is a polynomial there."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import SpectraFunction, measure_margins

DEGREE = 5
"""Of the polynomials through the margin on a box, along either side."""
GRID, STEPS = 41, 30
"""Points on a side from which the search for a critical point starts, and its Newton steps."""
BEYOND = 1.05
"""A tip may lie outside its box by this factor, as far as rounding of its sides goes."""
BLURRED = 4.0
"""A margin below so many times its own error is zero."""
FLAT = 1e-6
"""A second derivative this small beside the largest is none: sides that touch have no tip of their own inside."""


@dataclass(frozen=True)
class Tip:
    """Where two sides of the boundary meet, (2,), how far from it they may part, and whether the margin there is zero but for rounding."""

    point: Array
    error: float
    zero: bool


@dataclass(frozen=True)
class Margin:
    """The margin on a box as a polynomial of both coordinates, each from -1 to 1 in the box; how far rounding moves its values, and how
    far the polynomial may be off."""

    low: Array
    high: Array
    coefficients: Array
    rounding: float
    tail: float

    def derivative(self, points: Array, first: int, second: int) -> Array:
        """A derivative at points (V, 2) of [-1, 1]^2."""
        c = chebyshev.chebder(chebyshev.chebder(self.coefficients, first, axis=0), second, axis=1)
        return np.asarray(chebyshev.chebval2d(points[:, 0], points[:, 1], c))

    def place(self, point: Array) -> Array:
        """A point of the box in the coordinates of the unit square, inside it."""
        return np.clip((self.low + self.high) / 2 + point * (self.high - self.low) / 2, 0.0, 1.0)


def find_tip(
    low: tuple[float, float],
    high: tuple[float, float],
    angle: float,
    undamped: bool,
    function: SpectraFunction,
    tol: float,
) -> Tip | None:
    """The point of a box at which two sides of the boundary meet to within tol, or to within rounding, if there is one.

        m = 0,  grad m = 0,   or on a border of the unit square  m = 0,  dm/ds = 0   along it

    m: the margin, smooth through the boundary (`measure_margins`). There the sides part like (2 |m| / |largest eigenvalue of m''|)^(1/2).
    Parameters: low, high: of the box; angle, undamped: of the margin.
    Source: Seyranian, Mailybaev, Multiparameter Stability Theory (2003), section 2.9 (singularities of stability boundaries).
    """
    margin = fit_margin(np.array(low), np.array(high), angle, undamped, function)
    if margin is None:
        return None
    for tips in (find_on_borders(margin), [find_inside(margin)]):  # a flat cusp is critical all along its last part
        close = [tip for tip in tips if tip is not None and (tip.zero or tip.error <= tol)]
        if close:
            return min(close, key=lambda tip: tip.error)
    return None


def fit_margin(low: Array, high: Array, angle: float, undamped: bool, function: SpectraFunction) -> Margin | None:
    """The polynomial through the margin at Chebyshev's points of a box; none where it is not known."""
    nodes = chebyshev.chebpts1(DEGREE + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(nodes, nodes, indexing="ij"))
    places = (low + high) / 2 + np.stack([x, y], axis=1) * (high - low) / 2
    count = len(x)
    values, errors = measure_margins(function(places), np.full(count, undamped), np.full(count, angle))
    if not np.isfinite(values).all() or not np.isfinite(errors).all():
        return None
    matrix = chebyshev.chebvander2d(x, y, [DEGREE, DEGREE])
    coefficients = np.linalg.solve(matrix, values).reshape(DEGREE + 1, DEGREE + 1)
    tail = np.abs(coefficients[-1]).sum() + np.abs(coefficients[:, -1]).sum()
    return Margin(low, high, coefficients, float(np.median(errors)), float(tail))


def find_inside(margin: Margin) -> Tip | None:
    """The critical point of the margin in its box that lies nearest to the boundary."""
    side = np.linspace(-1, 1, GRID)
    points = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    steep = np.hypot(margin.derivative(points, 1, 0), margin.derivative(points, 0, 1))
    point = points[steep.argmin()]
    for _ in range(STEPS):
        gradient, hessian = derivatives(margin, point)
        move = np.linalg.lstsq(hessian, -gradient, rcond=FLAT)[0]
        point = np.clip(point + move, -2.0, 2.0)
    if np.abs(point).max() > BEYOND:
        return None
    return judge_tip(margin, point, float(np.abs(np.linalg.eigvalsh(derivatives(margin, point)[1])).max()))


def find_on_borders(margin: Margin) -> list[Tip | None]:
    """The tips at which the boundary ends on a border of the unit square: extrema of the margin along it."""
    tips = []
    for axis in range(2):
        for end, border in ((-1.0, margin.low[axis] <= 0.0), (1.0, margin.high[axis] >= 1.0)):
            if border:
                tips.append(find_on_border(margin, axis, end))
    return tips


def find_on_border(margin: Margin, axis: int, end: float) -> Tip | None:
    """The extremum of the margin along one side of its box, where coordinate `axis` is `end`."""
    order = (0, 1) if axis == 0 else (1, 0)

    def at(values: Array, times: int) -> Array:
        columns = (np.full(len(values), end), values)
        return margin.derivative(np.stack(columns if axis == 0 else columns[::-1], axis=1), *(times * k for k in order))

    side = np.linspace(-1, 1, GRID)
    value = side[np.abs(at(side, 1)).argmin()][None]
    for _ in range(STEPS):
        bend = at(value, 2)
        if not bend[0]:
            return None
        value = np.clip(value - at(value, 1) / bend, -2.0, 2.0)
    if np.abs(value).max() > BEYOND:
        return None
    point = np.array([end, value[0]]) if axis == 0 else np.array([value[0], end])
    return judge_tip(margin, point, float(np.abs(at(value, 2)[0])))


def derivatives(margin: Margin, point: Array) -> tuple[Array, Array]:
    """Gradient (2,) and second derivatives (2, 2)."""
    one = point[None]
    gradient = np.array([margin.derivative(one, 1, 0)[0], margin.derivative(one, 0, 1)[0]])
    mixed = margin.derivative(one, 1, 1)[0]
    return gradient, np.array([[margin.derivative(one, 2, 0)[0], mixed], [mixed, margin.derivative(one, 0, 2)[0]]])


def judge_tip(margin: Margin, point: Array, bend: float) -> Tip | None:
    """The tip with how far its sides may part there, by the margin that is left."""
    if not bend > 0:
        return None
    left = abs(float(margin.derivative(point[None], 0, 0)[0]))
    apart = np.sqrt(2 * (left + margin.rounding + margin.tail) / bend) * (margin.high - margin.low).max() / 2
    return Tip(margin.place(point), float(apart), left + margin.tail <= BLURRED * margin.rounding)
