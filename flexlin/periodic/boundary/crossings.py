"""All values of one parameter at which a periodic system becomes unstable or stable again."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.lattice import CELLS
from flexlin.periodic.boundary.lines import (
    LinesFunction,
    Peaks,
    Scan,
    add_tongues,
    list_changes,
    settles,
    solve_changes,
)
from flexlin.periodic.boundary.spectra import SCAN, Effort, Spectra, SpectraFunction, count_resting, drop_resting
from flexlin.periodic.precision import ROOT

SAMPLES = 1025
"""Values of the scan: no interval of instability wider than 1/1024 of the range lies between two of them."""


FINE = 4
"""Spectra that the last digits of a place take."""


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
    rough, fine = effort.counted(rough), effort.counted(fine)
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
    """Values of a rising grid and spectra there: all where a verdict could change, and fewer elsewhere, at least CELLS cells.

    A cell is divided unless `settles` says that its verdict is one; what the effort leaves undivided is its gap.
    """
    last = len(grid) - 1
    chosen = np.array([0, last])
    found = function(grid[chosen])
    while True:
        if len(chosen) > last:
            return grid, found
        wide = np.diff(chosen) > max(1, last // CELLS)
        open_ = np.flatnonzero((np.diff(chosen) > 1) & (wide | ~settles(found)))
        if not len(open_):
            return grid[chosen], found
        if not effort.affords(len(open_), SCAN):
            effort.gap = float(np.diff(grid[chosen])[open_].max())
            return grid[chosen], found
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
