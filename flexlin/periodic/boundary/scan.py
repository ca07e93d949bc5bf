"""Scans of a range of one parameter that leave out values between which nothing can change: for systems whose spectra take long."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.narrow import REACH
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction
from flexlin.periodic.circle import measure_distances

CELLS = 16
"""Cells of the coarsest scan."""
LIGHT = 0.1
"""A multiplier that decays so little over a period may meet others anywhere: its cells are always divided."""


def scan_sparsely(function: SpectraFunction, low: float, high: float, samples: int) -> tuple[Array, Spectra]:
    """Values and spectra of a scan that is as fine as `samples` equidistant values where a verdict could change, and coarser elsewhere.

    A cell is divided unless `settles` says that its verdict is one.
    """
    grid = np.linspace(low, high, samples)
    chosen = np.unique(np.linspace(0, samples - 1, min(CELLS, samples - 1) + 1).round().astype(int))
    found = function(grid[chosen])
    while True:
        wide = np.diff(chosen) > 1
        open_ = np.flatnonzero(wide & ~settles(found))
        if not len(open_):
            return grid[chosen], found
        middles = (chosen[open_] + chosen[open_ + 1]) // 2
        more = function(grid[middles])
        chosen = np.concatenate([chosen, middles])
        order = np.argsort(chosen)
        chosen = chosen[order]
        found = Spectra(
            np.concatenate([found.logs, more.logs])[order], np.concatenate([found.errors, more.errors])[order]
        )


def settles(scan: Spectra) -> Array:
    """Between which neighbours of a scan (V,) the verdict cannot change, (V - 1,).

    Where both are stable: every log of a multiplier is further from the axis than it moves across the cell, by the factor REACH, as for
    peaks of a scan. Where both are unstable: one that grows is so. Where neither has an answer there is nothing to find.
    """
    verdicts, known = scan.verdicts, scan.known
    logs = np.where(known[:, None], scan.logs, 0.0)
    apart = measure_distances(logs[:-1].T, logs[1:].T)  # (n, n, V - 1)
    there, back = REACH * apart.min(axis=1).T, REACH * apart.min(axis=0).T
    a, b = logs[:-1].real, logs[1:].real
    decays = np.all((-a > there + LIGHT) & (-b > back + LIGHT), axis=1)
    grows = np.any(a > there + LIGHT, axis=1) & np.any(b > back + LIGHT, axis=1)
    stable, unstable = (verdicts[1:] < 0) & (verdicts[:-1] < 0), (verdicts[1:] > 0) & (verdicts[:-1] > 0)
    return np.asarray((stable & decays) | (unstable & grows) | (~known[1:] & ~known[:-1]))
