"""All values of one parameter at which a periodic system becomes unstable or stable again."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.lattice import CELLS
from flexlin.periodic.boundary.lines import (
    REACH,
    ROOT,
    LinesFunction,
    Peaks,
    Scan,
    add_tongues,
    list_changes,
    nowhere,
    solve_changes,
)
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction, count_resting, drop_resting
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.product.perturbation import CLOSE

SAMPLES = 1025
"""Values of the scan: no interval of instability wider than 1/1024 of the range lies between two of them."""


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
    sparse: bool = False,
) -> list[Crossing]:
    """Every value between low and high at which the largest growth passes zero, in rising order.

    A scan of `samples` values finds every interval of instability wider than its step; what is narrower is looked for where multipliers
    meet between two values. Each change of verdict is then narrowed to tol / 4 by a function that is smooth through the boundary.

    Parameters: rough, fine: values (V,) -> spectra, cheap and as accurate as can be; tol: wanted error of a value;
    narrow: whether to look for tongues between two values; not where A does not depend on time, and multipliers meet without effect;
    sparse: whether to leave out values between which the verdict cannot change (`scan_sparsely`).
    """
    points, spectra = scan_sparsely(rough, np.linspace(low, high, samples), CELLS if sparse else samples - 1)
    resting, touching = count_resting(spectra), list[Crossing]()
    if resting == spectra.logs.shape[1]:
        return []

    def without_rest(function: SpectraFunction) -> LinesFunction:
        return lambda _, values: drop_resting(function(values), resting)

    scan = Scan(np.zeros(len(points), dtype=int), points, drop_resting(spectra, resting), without_rest(rough))
    if narrow:
        accuracy = max(tol / 4, ROOT**1.5 * (high - low))
        scan, peaks = add_tongues(scan, accuracy, settles if sparse else nowhere)
        touching = list_touching(peaks, scan.spectra)
    changes = list_changes(scan)
    if not len(changes.line):
        return touching
    near = max(tol / 4, ROOT * (high - low))
    guess = solve_changes(changes, scan.at, near).values
    zeros = solve_changes(changes, without_rest(fine), tol / 4, guess, 4 * near)
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


def scan_sparsely(function: SpectraFunction, grid: Array, cells: int) -> tuple[Array, Spectra]:
    """Values of a rising grid and spectra there: all where a verdict could change, and fewer elsewhere, at least so many cells.

    A cell is divided unless `settles` says that its verdict is one.
    """
    last = len(grid) - 1
    chosen = np.unique(np.linspace(0, last, min(cells, last) + 1).round().astype(int))
    found = function(grid[chosen])
    while True:
        if len(chosen) > last:
            return grid, found
        open_ = np.flatnonzero((np.diff(chosen) > 1) & ~settles(found))
        if not len(open_):
            return grid[chosen], found
        middles = (chosen[open_] + chosen[open_ + 1]) // 2
        chosen = np.concatenate([chosen, middles])
        order = np.argsort(chosen)
        chosen, found = chosen[order], found.beside(function(grid[middles])).at(order)


def settles(scan: Spectra) -> Array:
    """Between which neighbours of a scan (V,) the verdict cannot change, (V - 1,).

    Where both are stable: every log of a multiplier is further from the axis than it moves across the cell, by the factor REACH, as for
    peaks of a scan, and by CLOSE, since one that decays less may meet others anywhere. Where both are unstable: one that grows is so.
    Where neither has an answer there is nothing to find.
    """
    verdicts, known = scan.verdicts, scan.known
    logs = np.where(known[:, None], scan.logs, 0.0)
    apart = measure_distances(logs[:-1].T, logs[1:].T)  # (n, n, V - 1)
    there, back = REACH * apart.min(axis=1).T, REACH * apart.min(axis=0).T
    a, b = logs[:-1].real, logs[1:].real
    decays = np.all((-a > there + CLOSE) & (-b > back + CLOSE), axis=1)
    grows = np.any(a > there + CLOSE, axis=1) & np.any(b > back + CLOSE, axis=1)
    stable, unstable = (verdicts[1:] < 0) & (verdicts[:-1] < 0), (verdicts[1:] > 0) & (verdicts[:-1] > 0)
    return np.asarray((stable & decays) | (unstable & grows) | (~known[1:] & ~known[:-1]))


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
