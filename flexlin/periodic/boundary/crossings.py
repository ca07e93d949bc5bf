"""All values of one parameter at which a periodic system becomes unstable or stable again; over two parameters, on a lattice."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.checks import Array
from flexlin.periodic.boundary.follow import Vertices
from flexlin.periodic.boundary.lines import (
    LinesFunction,
    Peaks,
    Scan,
    add_quiet_strips,
    add_tongues,
    divide_unsettled,
    list_changes,
    settles,
    solve_changes,
)
from flexlin.periodic.boundary.spectra import SCAN, Effort, Spectra, SpectraFunction, count_resting, drop_resting
from flexlin.periodic.precision import ROOT, TINY

SAMPLES = 1025
"""Values of the scan: no interval of instability wider than 1/1024 of the range lies between two of them."""
FINE = 4
"""Spectra that the last digits of a place take."""
COARSE, CELLS = 8, 32
"""Cells of a scan at the least, of one with the time for it, and of the lattice on either side."""
AT_ONCE = 0.25
"""Part of the values that time allows which are computed before it is looked where the next ones lie."""
ROUNDS = 4
"""How often a peak is looked at more closely, at nine points of a square a third as large each time."""


@dataclass(frozen=True)
class Crossing:
    """A value at which the verdict changes, with its error; `inside` is an unstable value nearby.

    slope: of the margin (growth over a period, or D where `undamped`) by the parameter; `touching`: the whole interval of instability
    is too narrow to be resolved; then value and error hold all of it.
    """

    value: float
    error: float
    onset: bool
    inside: float
    slope: float
    undamped: bool
    touching: bool = False


def find_crossings(
    rough: SpectraFunction,
    fine: SpectraFunction,
    low: float,
    high: float,
    tol: float,
    samples: int = SAMPLES,
    narrow: bool = True,
    effort: Effort | None = None,
) -> list[Crossing]:
    """Every value between low and high at which the largest growth passes zero, in rising order.

    A scan of `samples` values, those left out between which the verdict cannot change (`settles`), finds every interval of instability
    wider than its step; what is narrower is looked for where multipliers meet between two values. Each change of verdict is then narrowed
    to tol / 4 by a function that is smooth through the boundary.

    Parameters: rough, fine: values (V,) -> spectra, cheap and as accurate as can be; tol: wanted error of a value;
    narrow: whether to look for tongues between two values; not where A does not depend on time, and multipliers meet without effect;
    effort: ends the search; places that are not narrowed by then have the width of their cells as their errors.
    """
    effort = effort or Effort()
    rough, fine = effort.timed(rough), effort.timed(fine)
    points, spectra = scan_line(rough, np.linspace(low, high, samples), effort)
    resting, touching = count_resting(spectra), list[Crossing]()
    if resting == spectra.logs.shape[1]:
        return []

    def without_rest(function: SpectraFunction) -> LinesFunction:
        return lambda _, values: drop_resting(function(values), resting)

    scan = Scan(np.zeros(len(points), dtype=int), points, drop_resting(spectra, resting), without_rest(rough))
    if narrow and not effort.gap:
        accuracy = max(tol / 4, ROOT**1.5 * (high - low))
        scan, peaks = add_tongues(scan, accuracy, effort)
        touching = list_touching(peaks, scan.spectra)
    changes = list_changes(scan)
    if not len(changes.line):
        return touching
    near = max(tol / 4, ROOT * (high - low))
    zeros = solve_changes(changes, scan.at, near, effort)
    if effort.affords(FINE * len(changes.line)) and not effort.unfinished:
        zeros = solve_changes(changes, without_rest(fine), tol / 4, effort, zeros.values, 4 * near)
    else:
        effort.unfinished = True
    rows = zip(
        zeros.values.tolist(),
        zeros.errors.tolist(),
        (changes.unstable > changes.quiet).tolist(),
        changes.unstable.tolist(),
        zeros.slopes.tolist(),
        changes.undamped.tolist(),
        strict=True,
    )
    return sorted([*(Crossing(*row) for row in rows), *touching], key=lambda one: (one.value, not one.onset))


def scan_line(function: SpectraFunction, grid: Array, effort: Effort) -> tuple[Array, Spectra]:
    """Values of a rising grid and spectra there: all where a verdict could change, and fewer elsewhere, COARSE cells at the least.

    A cell is divided unless `settles` says that its verdict is one, however multipliers turn in it where it is one of fewer than CELLS;
    these are divided at last, where time does. Where it does not do for all, a part of it goes to those nearest to what is asked about
    each time, so that these are settled first; a change may hide in the others, and in the narrowest that are not.
    """
    last = len(grid) - 1
    chosen = np.array([0, last])
    found = function(grid[chosen])
    while True:
        if len(chosen) > last:
            return grid, found
        settled, widths = settles(found), np.diff(chosen)
        wide, widest = (widths > max(1, last // cells) for cells in (CELLS, COARSE))
        sure = settled & ~widest & (~wide | settles(found, turning=True))
        share = SCAN if np.ptp(found.verdicts) else (1 + SCAN) / 2
        count, open_ = effort.count(share), np.flatnonzero((widths > 1) & ~sure)
        if not len(open_) and wide.sum() <= count:
            open_ = np.flatnonzero(wide)
        if not len(open_):
            return grid[chosen], found
        ends = np.stack([grid[chosen[:-1]], grid[chosen[1:]]])
        if count < 1:
            settled[open_] = False
            effort.leave(*ends[:, ~settled])
            return grid[chosen], found
        nearest = np.argsort(np.abs(ends[:, open_].mean(axis=0) - effort.about), kind="stable")
        open_ = open_[nearest[: int(min(np.ceil(AT_ONCE * count), len(open_)))]]
        middles = (chosen[open_] + chosen[open_ + 1]) // 2
        chosen = np.concatenate([chosen, middles])
        order = np.argsort(chosen)
        chosen, found = chosen[order], found.beside(function(grid[middles])).at(order)


def list_touching(peaks: Peaks, scan: Spectra) -> list[Crossing]:
    """Tongues closed to within rounding: an undamped multiplier meets its conjugate and no growth is seen."""
    closed = peaks.conjugate & ~peaks.unstable & (peaks.bend > 0) & (peaks.gap <= 4 * np.maximum(peaks.error, ROOT))
    if (scan.verdicts < 0).any():
        return []
    found = np.flatnonzero(closed)
    errors = np.maximum(peaks.gap, peaks.error)[found] / np.sqrt(peaks.bend[found])
    return [
        Crossing(value, error, onset, value, 0.0, True, True)
        for value, error in zip(peaks.values[found].tolist(), errors.tolist(), strict=True)
        for onset in (True, False)
    ]


def spread(xs: Array, ys: Array) -> Array:
    """The points (V, 2) of a lattice, x running slower."""
    return np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)


def find_islands(xs: Array, ys: Array, spectra: Spectra, function: SpectraFunction) -> tuple[Array, Array, Spectra]:
    """The lattice with a line through each island that no point of it met.

    Each local maximum of the growth rate among stable points, and each local minimum among unstable ones, is climbed by
    the best of nine points on a shrinking square.
    """
    shape = (len(xs), len(ys))
    growth, verdicts = spectra.logs.real.max(axis=1).reshape(shape), spectra.verdicts.reshape(shape)
    at = np.argwhere(find_peaks(growth, verdicts))
    if not len(at):
        return xs, ys, spectra
    way, places = -verdicts[tuple(at.T)], np.stack([xs[at[:, 0]], ys[at[:, 1]]], axis=1)
    step = np.array([xs[1] - xs[0], ys[1] - ys[0]])
    square = spread(*2 * [np.array([-1.0, 0.0, 1.0])])
    found, every = np.zeros(len(at), dtype=bool), np.arange(len(at))
    for _ in range(ROUNDS):
        step = step / 3
        tried = np.clip(places[:, None] + square * step, 0.0, 1.0)
        result = function(tried.reshape(-1, 2))
        best = np.nanargmax(way[:, None] * result.logs.real.max(axis=1).reshape(len(at), -1), axis=1)
        places = np.where(found[:, None], places, tried[every, best])
        found |= result.verdicts.reshape(len(at), -1)[every, best] == way
    if not found.any():
        return xs, ys, spectra
    wide, tall = np.union1d(xs, places[found, 0]), np.union1d(ys, places[found, 1])
    known = (np.isin(wide, xs)[:, None] & np.isin(tall, ys)).ravel()
    every = np.empty(len(known), dtype=int)
    every[known], every[~known] = np.arange(known.sum()), known.sum() + np.arange((~known).sum())
    return wide, tall, spectra.beside(function(spread(wide, tall)[~known])).at(every)


def find_peaks(growth: Array, verdicts: Array) -> Array:
    """Which points decay while all around decays faster, or grow while all around grows faster, by half as much as they do or more."""
    slide = np.lib.stride_tricks.sliding_window_view
    around = [slide(np.pad(one, 1, mode="edge"), (3, 3)) for one in (growth, verdicts)]
    least, most = around[0].min(axis=(2, 3)), around[0].max(axis=(2, 3))
    alike = (around[1] == verdicts[..., None, None]).all(axis=(2, 3))
    lifted = np.abs(growth) <= 2 * np.maximum(most - growth, growth - least)
    return alike & lifted & np.where(verdicts < 0, growth >= most, (verdicts > 0) & (growth <= least))


def find_nodes(
    xs: Array, ys: Array, spectra: Spectra, function: SpectraFunction, accuracy: float, narrow: bool
) -> tuple[Vertices, Array, Array]:
    """Every crossing of the boundary with the lines of a lattice, still without directions; the cell (V, 2) that the boundary enters at
    each one, and the cell that it leaves, -1 outside the lattice.

    With the unstable side on the left, a crossing of a line along x whose unstable side is at larger x runs towards smaller y,
    one of a line along y whose unstable side is at larger y towards larger x.
    Parameters: narrow: whether to look for tongues between lattice points.
    """
    shape = np.array([len(xs), len(ys)])

    def place(line: Array, values: Array) -> Array:
        """Lines along x, one for each y, and then those along y."""
        along, other = line < shape[1], np.concatenate([ys, xs])[line]
        return np.stack([np.where(along, values, other), np.where(along, other, values)], axis=1)

    index = np.arange(shape.prod()).reshape(shape)
    across, along = (np.repeat(np.arange(k), other) for k, other in (shape[::-1], shape))
    line = np.concatenate([across, shape[1] + along])
    known = spectra.at(np.concatenate([index.T.ravel(), index.ravel()]))
    values = np.concatenate([np.tile(xs, shape[1]), np.tile(ys, shape[0])])
    scan = Scan(line, values, known, lambda k, x: function(place(k, x)))
    scan = add_quiet_strips(divide_unsettled(scan) if narrow else scan, accuracy)
    found = list_changes(add_tongues(scan, accuracy)[0] if narrow else scan)
    zeros = solve_changes(found, scan.at, accuracy)
    points, inside = place(found.line, zeros.values), place(found.line, found.unstable)
    nodes = Vertices(points, np.zeros(points.shape), zeros.errors, found.angles, found.undamped, inside)
    along, middle = found.line < shape[1], place(found.line, found.between)
    cell = np.stack([np.searchsorted(xs, middle[:, 0]), np.searchsorted(ys, middle[:, 1])], axis=1)
    ahead = cell - np.stack([along, ~along], axis=1)
    behind = cell - 1
    forward = (along != (found.unstable > found.quiet))[:, None]
    cells = [np.where(forward, ahead, behind), np.where(forward, behind, ahead)]
    entered, left = (np.where(np.all((one >= 0) & (one < shape - 1), axis=1)[:, None], one, -1) for one in cells)
    return nodes, entered, left


def link_nodes(nodes: Vertices, entered: Array, left: Array) -> Array:
    """The node that follows each one (V,), -1 where the boundary leaves the range.

    Where several pieces of the boundary pass through one cell, those links are taken that bend least, by turning times length.
    Parameters: entered, left (V, 2): cells.
    """
    follower = np.full(len(entered), -1)
    for cell in np.unique(entered[entered[:, 0] >= 0], axis=0):
        coming, going = (np.flatnonzero((cells == cell).all(axis=1)) for cells in (entered, left))
        chord = nodes.points[going][None] - nodes.points[coming][:, None]
        length = np.linalg.norm(chord, axis=2)
        unit = chord / np.maximum(length, TINY)[..., None]
        ahead = np.einsum("ik,ijk->ij", nodes.directions[coming], unit)
        after = np.einsum("jk,ijk->ij", nodes.directions[going], unit)
        rows, columns = linear_sum_assignment(length * (2 - ahead - after))
        follower[coming[rows]] = going[columns]
    return follower
