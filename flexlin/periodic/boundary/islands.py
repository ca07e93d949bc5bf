"""Islands between the points of a lattice: peaks of the growth rate among stable points, and stable holes in unstable regions."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction

ROUNDS, SHRINK = 4, 0.35
"""How often a peak is looked at more closely, and by what part of the last step."""


def find_islands(xs: Array, ys: Array, spectra: Spectra, function: SpectraFunction) -> tuple[Array, Array, Spectra]:
    """The lattice with a line through each island that no point of it met.

    Each local maximum of the growth rate among stable points, and each local minimum among unstable ones, is climbed by
    the best of nine points on a shrinking square.
    """
    shape = (len(xs), len(ys))
    growth, verdicts = spectra.logs.real.max(axis=1).reshape(shape), spectra.verdicts.reshape(shape)
    sign = np.where(verdicts > 0, -1.0, 1.0)
    peaks = [(i, j) for i in range(shape[0]) for j in range(shape[1]) if is_peak(i, j, growth, verdicts)]
    if not peaks:
        return xs, ys, spectra
    at = np.array(peaks)
    way, places = sign[at[:, 0], at[:, 1]], np.stack([xs[at[:, 0]], ys[at[:, 1]]], axis=1)
    step = np.array([xs[1] - xs[0], ys[1] - ys[0]])
    square = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)])
    found = np.zeros(len(at), dtype=bool)
    for _ in range(ROUNDS):
        step = step * SHRINK
        tried = np.clip(places[:, None] + square * step, 0.0, 1.0)
        result = function(tried.reshape(-1, 2))
        height = way[:, None] * result.logs.real.max(axis=1).reshape(len(at), 9)
        best = np.nanargmax(height, axis=1)
        places = np.where(found[:, None], places, tried[np.arange(len(at)), best])
        verdict = result.verdicts.reshape(len(at), 9)[np.arange(len(at)), best]
        found |= np.where(way > 0, verdict > 0, verdict < 0)
    return add_lines(xs, ys, spectra, places[found], function)


def is_peak(i: int, j: int, growth: Array, verdicts: Array) -> bool:
    """Whether a point decays and its neighbours decay faster, or grows and its neighbours grow faster; neutral points are no peaks."""
    near = (slice(max(i - 1, 0), i + 2), slice(max(j - 1, 0), j + 2))
    if verdicts[i, j] == 0 or not np.all(verdicts[near] == verdicts[i, j]):
        return False
    around = verdicts[i, j] * (growth[i, j] - growth[near])
    lifted = abs(float(growth[i, j])) <= 2 * float(np.abs(around).max())
    return bool(lifted and np.all(around <= 0)) or bool(
        lifted and verdicts[i, j] < 0 and np.all(growth[near] <= growth[i, j])
    )


def add_lines(
    xs: Array, ys: Array, spectra: Spectra, places: Array, function: SpectraFunction
) -> tuple[Array, Array, Spectra]:
    """The lattice with lines through further places."""
    if not len(places):
        return xs, ys, spectra
    wide, tall = np.union1d(xs, places[:, 0]), np.union1d(ys, places[:, 1])
    points = np.stack(np.meshgrid(wide, tall, indexing="ij"), axis=-1).reshape(-1, 2)
    old = (np.isin(points[:, 0], xs) & np.isin(points[:, 1], ys)).reshape(-1)
    extra = function(points[~old])
    logs = np.empty((len(points), spectra.logs.shape[1]), dtype=complex)
    errors = np.empty(logs.shape)
    logs[old], logs[~old], errors[old], errors[~old] = spectra.logs, extra.logs, spectra.errors, extra.errors
    return wide, tall, Spectra(logs, errors)
