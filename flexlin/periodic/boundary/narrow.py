"""Tongues between the values of a scan: where multipliers meet, or growth has a peak, between two neighbours."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.roots import SignedEnds, solve_brackets
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction, measure_meetings

STEPS = 14
"""Steps towards a peak; a parabola through three values of a smooth function needs about six."""
REACH = 2.0
"""A pair whose decay over a period exceeds its motion across a cell by this factor is not lifted to growth inside the cell alone."""

UNLIKE = 0.5
"""Angles of multipliers that differ by more belong to different tongues."""

LinesFunction = Callable[[Array, Array], Spectra]
"""Indices (W,) and values (W,) -> spectra: many scans, each of its own."""


@dataclass(frozen=True)
class Peaks:
    """Highest places of functions between two neighbours: where, whether it is unstable there, and how far apart multipliers stay.

    gap: distance of the logs of the two multipliers that meet, as small as it gets (V,); bend: -D''/2 there, > 0; angle 0 or pi: whether
    a multiplier meets its own conjugate; error: of the logs there.
    """

    points: Array
    unstable: Array
    gap: Array
    bend: Array
    conjugate: Array
    error: Array


def measure_heights(spectra: Spectra) -> Array:
    """Functions that peak where a tongue may hide, (V, J + 1): D of each pair of neighbours, and the largest growth."""
    meetings, _ = measure_meetings(spectra)
    return np.concatenate([meetings, spectra.logs.real.max(axis=1, keepdims=True)], axis=1)


def find_peaks(
    points: Array, spectra: Spectra, function: SpectraFunction, accuracy: float, settled: Array | None = None
) -> Peaks:
    """Climb every peak of `measure_heights` between values (V,) that are not unstable.

    Parameters: accuracy: of the place of a peak; settled (V - 1,): cells in which none is looked for.
    """
    return climb_peaks(list_slopes(points, spectra, settled), lambda which, values: function(values), accuracy)


@dataclass(frozen=True)
class Slopes:
    """Three neighbouring values (3, V) about each peak, the heights there, which function it is, and the error of the logs, (V,)."""

    x: Array
    f: Array
    column: Array
    error: Array
    conjugate: Array


def list_slopes(points: Array, spectra: Spectra, settled: Array | None = None) -> Slopes:
    """The peaks of a scan, each with its two neighbours; those with settled cells (V - 1,) on both sides are left out."""
    heights, quiet = measure_heights(spectra), spectra.verdicts <= 0
    index, column = list_peaks(heights, quiet, spectra)
    if settled is not None:
        open_ = ~(settled[index - 1] & settled[index])
        index, column = index[open_], column[open_]
    three = index + np.arange(-1, 2)[:, None]
    last = heights.shape[1] - 2
    conjugate = (column == 0) | (column == last)
    return Slopes(points[three], heights[three, column], column, widest_error(spectra)[index], conjugate)


def climb_peaks(start: Slopes, function: LinesFunction, accuracy: float) -> Peaks:
    """Climb by parabolas through three values, until a system is unstable or two multipliers have met.

    Parameters: function: (indices (W,), values (W,)) -> spectra; accuracy: of the place of a peak.
    Source: Brent, Algorithms for Minimization without Derivatives (1973), ch. 5: successive parabolic interpolation.
    """
    x, f, error = start.x.copy(), start.f.copy(), start.error.copy()
    unstable, climbing = np.zeros(len(error), dtype=bool), np.ones(len(error), dtype=bool)
    bend = np.maximum(-fit_curvature(x, f), 0.0)
    for _ in range(STEPS):
        which = np.flatnonzero(climbing)
        if not len(which):
            break
        new = place_vertex(x[:, which], f[:, which])
        found = function(which, new)
        value = measure_heights(found)[np.arange(len(which)), start.column[which]]
        error[which], unstable[which] = widest_error(found), found.verdicts > 0
        moved = np.abs(new - x[1, which])
        x[:, which], f[:, which] = enclose_peak(x[:, which], f[:, which], new, value)
        x[1, which] = np.where(unstable[which], new, x[1, which])
        met = np.abs(f[1, which]) <= error[which] ** 2
        climbing[which] = ~unstable[which] & (moved > accuracy) & ~met
    return Peaks(x[1], unstable, 2 * np.sqrt(np.maximum(-f[1], 0.0)), bend, start.conjugate, error)


def list_strips(points: Array, spectra: Spectra) -> tuple[Array, Array, Array, Array]:
    """Neighbours, both unstable, whose growing multipliers stand at unlike angles, (V,) each with the angles there: between them the
    system may be quiet."""
    angle = np.abs(spectra.logs.imag[np.arange(len(points)), spectra.leading])
    unstable = spectra.verdicts > 0
    index = np.flatnonzero(unstable[1:] & unstable[:-1] & (np.abs(np.diff(angle)) > UNLIKE))
    return points[index], points[index + 1], angle[index], angle[index + 1]


def find_strips(
    first: Array, second: Array, angles: tuple[Array, Array], function: LinesFunction, accuracy: float
) -> Array:
    """A quiet value between each pair of unstable ones, not a number where one tongue goes over into the next.

    Zero of the squared growth, taken as positive where the growing multiplier stands nearer to the first one's angle.
    """

    def signed(which: Array, values: Array) -> Array:
        found = function(which, values)
        rows = np.arange(len(which))
        lead = found.logs[rows, found.leading]
        nearer = np.abs(np.abs(lead.imag) - angles[0][which]) <= np.abs(np.abs(lead.imag) - angles[1][which])
        return np.where(found.verdicts > 0, np.where(nearer, 1.0, -1.0) * lead.real**2, 0.0)

    every = np.arange(len(first))
    ends = solve_brackets(signed, SignedEnds(first, second, signed(every, first), signed(every, second)), accuracy)
    return np.where(ends.at_a == 0, ends.a, np.where(ends.at_b == 0, ends.b, np.nan))


def widest_error(spectra: Spectra) -> Array:
    """The largest finite error of each spectrum, (V,)."""
    return np.asarray(np.max(np.where(np.isfinite(spectra.errors), spectra.errors, 0.0), axis=1))


def list_peaks(heights: Array, quiet: Array, spectra: Spectra) -> tuple[Array, Array]:
    """Index and column of each inner maximum between quiet neighbours that could rise to growth."""
    inner = quiet[1:-1] & quiet[:-2] & quiet[2:]
    top = (heights[1:-1] >= heights[:-2]) & (heights[1:-1] >= heights[2:])
    top &= (heights[1:-1] > heights[:-2]) | (heights[1:-1] > heights[2:])
    drop = np.maximum(heights[1:-1] - np.minimum(heights[:-2], heights[2:]), 0.0)
    growth = np.concatenate([measure_meetings(spectra)[1], spectra.logs.real.max(axis=1, keepdims=True)], axis=1)[1:-1]
    near = -growth <= REACH * np.concatenate([np.sqrt(drop[:, :-1]), drop[:, -1:]], axis=1)
    index, column = np.nonzero(inner[:, None] & top & near)
    return index + 1, column


def list_end_peaks(points: Array, spectra: Spectra) -> Array:
    """Values inside the first and the last cell of a scan where a parabola through three values has its top."""
    tops = []
    for end in (np.arange(3), np.arange(len(points) - 3, len(points))):
        x, f = points[end][:, None], measure_heights(spectra.at(end))
        tops.append(find_top(np.broadcast_to(x, f.shape), f))
    top, step = np.concatenate(tops), 1e-9 * (points[-1] - points[0])
    first, last = (
        (top > points[0] + step) & (top < points[1] - step),
        (top > points[-2] + step) & (top < points[-1] - step),
    )
    return np.unique(top[first | last])


def find_top(x: Array, f: Array) -> Array:
    """Where the parabola through three points (3, V) has its extremum; not finite for a straight line."""
    left, right = x[1] - x[0], x[2] - x[1]
    p, q = left * (f[1] - f[2]), right * (f[1] - f[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(x[1] - 0.5 * (left * p - right * q) / (p + q))


def fit_curvature(x: Array, f: Array) -> Array:
    """The coefficient of the square in the parabola through three points (3, V)."""
    return ((f[2] - f[1]) / (x[2] - x[1]) - (f[1] - f[0]) / (x[1] - x[0])) / (x[2] - x[0])


def place_vertex(x: Array, f: Array) -> Array:
    """The top of the parabola through three points (3, V) about a peak; inside them, and off the middle one."""
    left, right, top = x[1] - x[0], x[2] - x[1], find_top(x, f)
    wide = np.where(left > right, x[1] - 0.38 * left, x[1] + 0.38 * right)
    inside = np.isfinite(top) & (top > x[0]) & (top < x[2]) & (top != x[1])
    return np.where(inside, top, wide)


def enclose_peak(x: Array, f: Array, new: Array, value: Array) -> tuple[Array, Array]:
    """The three of four points (3, V) about the highest."""
    four, heights = np.concatenate([x, new[None]]), np.concatenate([f, value[None]])
    order = np.argsort(four, axis=0, kind="stable")
    four, heights = np.take_along_axis(four, order, axis=0), np.take_along_axis(heights, order, axis=0)
    best = np.clip(heights.argmax(axis=0), 1, 2)
    rows = best + np.arange(-1, 2)[:, None]
    return np.take_along_axis(four, rows, axis=0), np.take_along_axis(heights, rows, axis=0)
