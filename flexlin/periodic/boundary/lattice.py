"""A lattice over two parameters: islands between its points, where the boundary crosses its lines, and which crossing follows which."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.checks import Array
from flexlin.periodic.boundary.follow import Vertices
from flexlin.periodic.boundary.lines import Scan, add_quiet_strips, add_tongues, list_changes, solve_changes
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction
from flexlin.periodic.precision import TINY

CELLS = 32
"""Cells of the coarsest scan, and of the lattice on either side."""
ROUNDS = 4
"""How often a peak is looked at more closely, at nine points of a square a third as large each time."""


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
    wide, tall = np.union1d(xs, places[found, 0]), np.union1d(ys, places[found, 1])
    known = (np.isin(wide, xs)[:, None] & np.isin(tall, ys)).ravel()
    every = np.empty(len(known), dtype=int)
    every[known], every[~known] = np.arange(known.sum()), known.sum() + np.arange((~known).sum())
    return wide, tall, spectra.beside(function(spread(wide, tall)[~known])).at(every)


def find_peaks(growth: Array, verdicts: Array) -> Array:
    """Which points decay while all around decays faster, or grow while all around grows faster, by half as much as they do or more."""
    around = [
        np.lib.stride_tricks.sliding_window_view(np.pad(one, 1, mode="edge"), (3, 3)) for one in (growth, verdicts)
    ]
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
    line = np.concatenate(
        [np.repeat(np.arange(shape[1]), shape[0]), shape[1] + np.repeat(np.arange(shape[0]), shape[1])]
    )
    known = spectra.at(np.concatenate([index.T.ravel(), index.ravel()]))
    values = np.concatenate([np.tile(xs, shape[1]), np.tile(ys, shape[0])])
    scan = add_quiet_strips(Scan(line, values, known, lambda k, x: function(place(k, x))), accuracy)
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
