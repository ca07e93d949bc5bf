"""The boundary over two parameters: where it crosses a lattice, and between two of its points: cubic pieces, halved until they agree."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.checks import Array
from flexlin.periodic.boundary.crossings import (
    Scan,
    add_quiet_strips,
    add_tongues,
    divide_unsettled,
    list_changes,
    solve_changes,
)
from flexlin.periodic.boundary.spectra import Columns, Effort, Spectra, SpectraFunction, measure_margins
from flexlin.periodic.roots import SignedEnds, solve_brackets
from flexlin.precision import FOURTH_ROOT_EPS, TINY

GRADIENT_STEP = FOURTH_ROOT_EPS
"""Of the ranges: the step of the differences that give the margin's gradient, whose only use is the direction of the boundary.

Exact derivatives cost 170 to 400 times as much as four values of the compiled kernel (13 times with 12 states), and turn it by 1e-5 rad
at the most.
"""
EXACT_PARTS = 8.0
"""Points of the boundary are placed to this part of the wanted error; also how many times farther from a piece's middle each next look
for the boundary goes."""
PEAK_ROUNDS = 4
"""How often a peak of a lattice is looked at more closely, at nine points of a square a third as large each time."""


@dataclass(frozen=True)
class Vertices(Columns):
    """Points (V, 2) of the boundary in the unit square: direction (V, 2) with the unstable side on the left, error (V,), and the margin
    by which they were found: angle of the growing multiplier and whether it is undamped; an unstable point nearby (V, 2)."""

    points: Array
    directions: Array
    errors: Array
    angles: Array
    undamped: Array
    inside: Array


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
    for _ in range(PEAK_ROUNDS):
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
    found = list_changes(add_tongues(scan, accuracy, Effort())[0] if narrow else scan)
    zeros, errors, _ = solve_changes(found, scan.at, accuracy, Effort())
    points, inside = place(found.line, zeros), place(found.line, found.ends.points[1])
    nodes = Vertices(points, np.zeros(points.shape), errors, found.angles, found.undamped, inside)
    along, middle = found.line < shape[1], place(found.line, found.between)
    cell = np.stack([np.searchsorted(xs, middle[:, 0]), np.searchsorted(ys, middle[:, 1])], axis=1)
    ahead = cell - np.stack([along, ~along], axis=1)
    behind = cell - 1
    forward = (along != found.rising)[:, None]
    cells = [np.where(forward, ahead, behind), np.where(forward, behind, ahead)]
    entered, left = (np.where(np.all((one >= 0) & (one < shape - 1), axis=1)[:, None], one, -1) for one in cells)
    return nodes, entered, left


def measure_chords(points: Array, others: Array) -> tuple[Array, Array]:
    """Lengths (...,) and directions (..., 2) of the ways from points (..., 2) to others."""
    chord = others - points
    length = np.linalg.norm(chord, axis=-1)
    return length, chord / np.maximum(length, TINY)[..., None]


def link_nodes(nodes: Vertices, entered: Array, left: Array) -> Array:
    """The node that follows each one (V,), -1 where the boundary leaves the range.

    Where several pieces of the boundary pass through one cell, those links are taken that bend least, by turning times length.
    Parameters: entered, left (V, 2): cells.
    """
    follower = np.full(len(entered), -1)
    for cell in np.unique(entered[entered[:, 0] >= 0], axis=0):
        coming, going = (np.flatnonzero((cells == cell).all(axis=1)) for cells in (entered, left))
        length, unit = measure_chords(nodes.points[coming][:, None], nodes.points[going])
        ahead = np.einsum("ik,ijk->ij", nodes.directions[coming], unit)
        after = np.einsum("jk,ijk->ij", nodes.directions[going], unit)
        rows, columns = linear_sum_assignment(length * (2 - ahead - after))
        follower[coming[rows]] = going[columns]
    return follower


def find_directions(vertices: Vertices, function: SpectraFunction, step: float) -> Vertices:
    """Vertices with unit tangents of the boundary, unstable side on the left, by central differences of the margin."""
    moves = step * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    places = np.clip(vertices.points[None] + moves[:, None], 0.0, 1.0)
    spectra = function(places.reshape(-1, 2))
    margin = measure_margins(spectra, np.tile(vertices.undamped, 4), np.tile(vertices.angles, 4))[0].reshape(4, -1)
    across = (margin[0] - margin[1]) / (places[0, :, 0] - places[1, :, 0])
    up = (margin[2] - margin[3]) / (places[2, :, 1] - places[3, :, 1])
    directions = np.stack([up, -across], axis=1) / np.maximum(np.hypot(across, up), TINY)[:, None]
    return replace(vertices, directions=directions)


def place_cubic(first: Vertices, second: Vertices, share: Array) -> Array:
    """Points (V, S, 2) at shares (S,), or (V, S), of the cubics through two vertices with their directions."""
    length = np.linalg.norm(second.points - first.points, axis=1)[:, None, None]
    s = np.atleast_2d(share)[..., None]
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * first.points[:, None]
        + s**2 * (3 - 2 * s) * second.points[:, None]
        + length * s * (1 - s) * ((1 - s) * first.directions[:, None] - s * second.directions[:, None])
    )


def find_middles(
    first: Vertices, second: Vertices, function: SpectraFunction, accuracy: float
) -> tuple[Vertices, Array, Array]:
    """Points of the boundary on the normals of the cubics' middles, how far off they lie (V,), infinite where none was met, and the
    margin's slopes there (V,)."""
    length = np.linalg.norm(second.points - first.points, axis=1)
    middle = place_cubic(first, second, np.array([0.5]))[:, 0]
    along = 6 * (second.points - first.points) - length[:, None] * (first.directions + second.directions)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(along, axis=1), TINY)[:, None]
    both = np.exp(1j * first.angles) + np.exp(1j * second.angles)
    angles = np.where(np.abs(both) > 0.5, np.angle(both), first.angles)  # not of opposite ones, as at -1
    undamped = first.undamped & second.undamped

    def margin(which: Array, offsets: Array) -> tuple[Array, Array]:
        places = np.clip(middle[which] + offsets[:, None] * normal[which], 0.0, 1.0)
        return measure_margins(function(places), undamped[which], angles[which])

    here, unknown = margin(np.arange(len(middle)), 0.0 * length)
    there, farther, outer = here.copy(), unknown.copy(), np.zeros(len(middle))
    offset, which = GRADIENT_STEP, np.flatnonzero(here)
    while len(which):  # the margin's sign says on which side the boundary lies
        outer[which] = -np.sign(here[which]) * min(offset, 1.0) * length[which]
        there[which], farther[which] = margin(which, outer[which])
        which = which[(np.sign(there) == np.sign(here))[which] & (offset < 1)]
        offset *= EXACT_PARTS
    met = np.flatnonzero(here * there <= 0)
    pairs = (0.0 * outer, outer), (here, there), (unknown, farther)
    start = SignedEnds(*(np.array(pair)[:, met] for pair in pairs))
    ends = solve_brackets(lambda k, x: margin(met[k], x), start, accuracy)
    best, left, unsure = ends.best
    off, error, slope = np.full(len(middle), np.inf), np.zeros(len(middle)), np.full(len(middle), TINY)
    reach = np.maximum(start.width, TINY)
    slope[met] = np.maximum(np.abs(there - here)[met] / reach, TINY)
    error[met] = np.minimum((left + unsure) / slope[met], reach) + ends.width / 2
    off[met], middle[met] = np.abs(best), middle[met] + best[:, None] * normal[met]
    points = np.clip(middle, 0.0, 1.0)
    return Vertices(points, np.zeros(points.shape), error, angles, undamped, first.inside), off, slope


def measure_quarters(
    first: Vertices, second: Vertices, found: Vertices, slope: Array, function: SpectraFunction
) -> Array:
    """How far off the boundary lies a quarter of the way from either end of the cubics (V,), by the margin there and its slopes (V,).

    A cubic whose directions are wrong may leave the boundary on either side of a middle that lies on it.
    """
    places = np.clip(place_cubic(first, second, np.array([0.25, 0.75])), 0.0, 1.0)
    spectra = function(places.reshape(-1, 2))
    left, uncertain = measure_margins(spectra, np.repeat(found.undamped, 2), np.repeat(found.angles, 2))
    return np.asarray(np.maximum(np.abs(left) - uncertain, 0.0).reshape(-1, 2).max(axis=1) / slope)
