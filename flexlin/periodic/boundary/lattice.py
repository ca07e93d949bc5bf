"""Spectra on the lines of a lattice over two parameters, and the points at which the boundary crosses these lines."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.narrow import (
    Slopes,
    climb_peaks,
    find_strips,
    list_end_peaks,
    list_slopes,
    list_strips,
)
from flexlin.periodic.boundary.roots import SignedEnds, solve_brackets
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction, measure_margins


@dataclass(frozen=True)
class Line:
    """One line of the lattice: axis 0 runs along x at fixed y, axis 1 the other way; values (V,) along it, and spectra there."""

    axis: int
    index: int
    place: float
    values: Array
    spectra: Spectra

    def points(self, values: Array) -> Array:
        """Points (V, 2) of the line."""
        columns = (values, np.full(len(values), self.place))
        return np.stack(columns if self.axis == 0 else columns[::-1], axis=1)


@dataclass(frozen=True)
class Nodes:
    """Points (V, 2) of the boundary on lines of a lattice.

    axis, line, cell: which line, and between which two of its lattice points; rising: whether the unstable side has the larger
    coordinate; angle of the multiplier that leaves the circle there; undamped: kind of margin; inside (V, 2): an unstable point nearby;
    error (V,): along the line, as a share of the range.
    """

    points: Array
    axis: Array
    line: Array
    cell: Array
    rising: Array
    angle: Array
    undamped: Array
    inside: Array
    error: Array

    def __len__(self) -> int:
        return len(self.points)


def lay_lines(xs: Array, ys: Array, spectra: Spectra) -> list[Line]:
    """The lines of a lattice with spectra at its points, x running slower."""
    shape = (len(xs), len(ys), -1)
    logs, errors = spectra.logs.reshape(shape), spectra.errors.reshape(shape)
    along = [Line(0, j, y, xs, Spectra(logs[:, j], errors[:, j])) for j, y in enumerate(ys)]
    return along + [Line(1, i, x, ys, Spectra(logs[i], errors[i])) for i, x in enumerate(xs)]


def add_narrow_tongues(lines: list[Line], function: SpectraFunction, accuracy: float) -> list[Line]:
    """The lines with further points in tongues that pass between two of their points; all lines are searched together."""
    ends = [list_end_peaks(line.values, line.spectra) for line in lines]
    lines = insert_values(lines, ends, function)
    slopes = [list_slopes(line.values, line.spectra) for line in lines]
    owner = np.repeat(np.arange(len(lines)), [len(one.column) for one in slopes])
    every = Slopes(
        *(np.concatenate([getattr(one, name) for one in slopes], axis=-1) for name in Slopes.__annotations__)
    )

    def at(which: Array, values: Array) -> Spectra:
        return function(place_on_lines(lines, owner[which], values))

    peaks = climb_peaks(every, at, accuracy)
    more = [np.unique(peaks.points[peaks.unstable & (owner == k)]) for k in range(len(lines))]
    return insert_values(lines, more, function)


def add_quiet_strips(lines: list[Line], function: SpectraFunction, accuracy: float) -> list[Line]:
    """The lines with further points in quiet strips between two tongues that lie in neighbouring points."""
    strips = [list_strips(line.values, line.spectra) for line in lines]
    owner = np.repeat(np.arange(len(lines)), [len(one[0]) for one in strips])
    if not len(owner):
        return lines
    first, second, before, after = (np.concatenate([one[k] for one in strips]) for k in range(4))

    def at(which: Array, values: Array) -> Spectra:
        return function(place_on_lines(lines, owner[which], values))

    quiet = find_strips(first, second, (before, after), at, accuracy)
    more = [np.unique(quiet[np.isfinite(quiet) & (owner == k)]) for k in range(len(lines))]
    return insert_values(lines, more, function)


def place_on_lines(lines: list[Line], owner: Array, values: Array) -> Array:
    """Points (V, 2) at values on the lines `owner` (V,)."""
    axis, place = np.array([line.axis for line in lines]), np.array([line.place for line in lines])
    first = np.where(axis[owner] == 0, values, place[owner])
    return np.stack([first, np.where(axis[owner] == 0, place[owner], values)], axis=1)


def insert_values(lines: list[Line], more: list[Array], function: SpectraFunction) -> list[Line]:
    """The lines with further values and the spectra there."""
    if not any(len(values) for values in more):
        return lines
    extra = function(np.concatenate([line.points(values) for line, values in zip(lines, more, strict=True)]))
    first, result = 0, []
    for line, values in zip(lines, more, strict=True):
        part = slice(first, first + len(values))
        together = np.concatenate([line.values, values])
        order = np.argsort(together, kind="stable")
        logs = np.concatenate([line.spectra.logs, extra.logs[part]])[order]
        errors = np.concatenate([line.spectra.errors, extra.errors[part]])[order]
        result.append(Line(line.axis, line.index, line.place, together[order], Spectra(logs, errors)))
        first += len(values)
    return result


def find_nodes(lines: list[Line], xs: Array, ys: Array, function: SpectraFunction, accuracy: float) -> Nodes:
    """Every crossing of the boundary with the lines, all narrowed together."""
    found = [list_changes(line) for line in lines]
    owner = np.repeat(np.arange(len(lines)), [len(one[0]) for one in found])
    quiet, unstable, angle, undamped = (np.concatenate([one[k] for one in found]) for k in range(4))

    def margin(which: Array, values: Array) -> tuple[Array, Array]:
        spectra = function(place_on_lines(lines, owner[which], values))
        return measure_margins(spectra, undamped[which], angle[which])

    every = np.arange(len(owner))
    at_quiet, at_unstable = margin(every, quiet)[0], margin(every, unstable)[0]
    start = SignedEnds(quiet, unstable, np.minimum(at_quiet, -1e-300), np.maximum(at_unstable, 1e-300))
    ends = solve_brackets(lambda which, x: margin(which, x)[0], start, accuracy)
    value, slope = ends.best, np.abs(at_unstable - at_quiet) / np.abs(unstable - quiet)
    left, uncertain = margin(every, value)
    error = np.minimum((np.abs(left) + uncertain) / slope, np.abs(unstable - quiet)) + ends.width / 2
    axis = np.array([line.axis for line in lines])[owner]
    marks = [xs if line.axis == 0 else ys for line in lines]
    cell = np.array(
        [np.searchsorted(marks[k], (a + b) / 2) - 1 for k, a, b in zip(owner, quiet, unstable, strict=True)]
    )
    index = np.array([line.index for line in lines])[owner]
    inside = place_on_lines(lines, owner, unstable)
    points = place_on_lines(lines, owner, value)
    return Nodes(points, axis, index, cell.astype(int), unstable > quiet, angle, undamped, inside, error)


def list_changes(line: Line) -> tuple[Array, Array, Array, Array]:
    """Quiet and unstable end of every change of verdict along a line, angle of the growing multiplier, and whether it is undamped."""
    verdicts = line.spectra.verdicts
    known = line.spectra.known
    edges = np.flatnonzero(((verdicts[1:] > 0) != (verdicts[:-1] > 0)) & known[1:] & known[:-1])
    rising = verdicts[edges + 1] > 0
    quiet, unstable = np.where(rising, edges, edges + 1), np.where(rising, edges + 1, edges)
    beyond = np.clip(quiet + np.where(rising, -1, 1), 0, len(verdicts) - 1)
    undamped = (verdicts[quiet] == 0) & (verdicts[beyond] >= 0)
    angle = line.spectra.logs.imag[np.arange(len(verdicts)), line.spectra.leading][unstable]
    return line.values[quiet], line.values[unstable], angle, undamped
