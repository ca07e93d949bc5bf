"""All curves in a rectangle of two parameters at which a periodic system becomes unstable."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.follow import Vertices, place_cubic
from flexlin.periodic.boundary.links import list_chains
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction, count_resting, drop_resting
from flexlin.periodic.boundary.trace import SMALLEST, Box, Trace, trace_box

CELLS = 32
"""Cells of the lattice on either side."""
MOST = 400
"""Points on one cubic."""


@dataclass(frozen=True)
class Curve:
    """A piece of the boundary in the unit square: points (N, 2), their errors (N,), whether it is closed, and an unstable point nearby."""

    points: Array
    errors: Array
    closed: bool
    inside: Array


def find_curves(function: SpectraFunction, tol: float, cells: int = CELLS, constant: bool = False) -> list[Curve]:
    """The curves along which the largest growth passes zero, with the unstable side on their left.

    Spectra on the lines of a lattice give the points at which the boundary crosses them; through each cell, points are joined by cubics
    whose middles are compared with the boundary itself and which are halved until they agree. A cell through which the boundary cannot
    be followed that way, at the tip of a tongue, is divided again, until both sides meet there to within rounding (`find_tip`).

    Parameters: function: points (V, 2) of the unit square -> spectra; tol: wanted distance from the exact boundary;
    constant: whether A does not depend on time, so that multipliers may meet without any effect.
    """
    some = function(np.random.default_rng(0).random((8, 2)))
    resting = count_resting(some)
    if resting == some.logs.shape[1]:
        return []

    def moving(points: Array) -> Spectra:
        return drop_resting(function(points), resting)

    trace = trace_box(Box((0.0, 0.0), (1.0, 1.0), cells), moving, tol, not constant)
    curves = [draw_curve(chain, closed, trace, tol) for chain, closed in list_chains(trace.follower)]
    return [curve for curve in curves if np.ptp(curve.points, axis=0).max() > SMALLEST]


def draw_curve(chain: Array, closed: bool, trace: Trace, tol: float) -> Curve:
    """Points on the cubics, as close as the wanted error asks of a polyline; errors of the vertices and of the cubics together."""
    first, second = trace.vertices.at(chain[:-1]), trace.vertices.at(chain[1:])
    counts = count_points(first, second, tol)
    points, errors = [], []
    for k, count in enumerate(counts):
        one = np.array([k])
        points.append(place_cubic(first.at(one), second.at(one), np.arange(count) / count)[0])
        between = np.where(np.arange(count) > 0, 2 * trace.off[chain[k]] + tol / 4, 0.0)
        errors.append(np.maximum(first.errors[k], second.errors[k]) + between)
    corners = np.concatenate([*points, second.points[-1:]]), np.concatenate([*errors, second.errors[-1:]])
    inside = trace.inside[chain][np.isfinite(trace.inside[chain][:, 0])]
    return Curve(np.clip(corners[0], 0.0, 1.0), corners[1], closed, inside[len(inside) // 2])


def count_points(first: Vertices, second: Vertices, tol: float) -> Array:
    """How many chords each cubic needs, so that none is farther from it than tol / 4."""
    chord = second.points - first.points
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.maximum(length, 1e-300)[:, None]
    turn = np.linalg.norm(first.directions - unit, axis=1) + np.linalg.norm(second.directions - unit, axis=1)
    return np.where(length > 0, np.clip(np.ceil(np.sqrt(turn * length / (2 * tol))), 1, MOST), 1).astype(int)
