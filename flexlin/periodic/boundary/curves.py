"""All curves in a rectangle of two parameters at which a periodic system becomes unstable."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.follow import Vertices, find_directions, place_cubic, refine_pieces
from flexlin.periodic.boundary.islands import find_islands
from flexlin.periodic.boundary.lattice import Nodes, add_narrow_tongues, find_nodes, lay_lines
from flexlin.periodic.boundary.links import link_nodes, list_chains
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction, count_resting, drop_resting

CELLS = 32
"""Cells of the lattice on either side."""


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
    whose middles are compared with the boundary itself and which are halved until they agree.

    Parameters: function: points (V, 2) of the unit square -> spectra; tol: wanted distance from the exact boundary.
    """
    xs = ys = np.linspace(0.0, 1.0, cells + 1)
    spectra = function(lattice_points(xs, ys))
    resting = count_resting(spectra)

    def moving(points: Array) -> Spectra:
        return drop_resting(function(points), resting)

    spectra = drop_resting(spectra, resting)
    xs, ys, spectra = find_islands(xs, ys, spectra, moving)
    lines = lay_lines(xs, ys, spectra)
    if not constant:
        lines = add_narrow_tongues(lines, moving, tol)
    nodes = find_nodes(lines, xs, ys, moving, tol / 50)
    if not len(nodes):
        return []
    directions = find_directions(nodes.points, nodes.angle, nodes.undamped, moving)[0]
    follower = link_nodes(nodes, directions, (len(xs), len(ys)))
    linked = np.flatnonzero(follower >= 0)
    vertices = Vertices(nodes.points, directions, nodes.error, nodes.angle, nodes.undamped)
    vertices, pieces = refine_pieces(vertices, np.stack([linked, follower[linked]], axis=1), moving, tol)
    return assemble_curves(nodes, follower, vertices, pieces, tol)


def lattice_points(xs: Array, ys: Array) -> Array:
    """Points (V, 2) of the lattice, x running slower."""
    return np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)


def assemble_curves(
    nodes: Nodes, follower: Array, vertices: Vertices, pieces: dict[int, tuple[int, float]], tol: float
) -> list[Curve]:
    """Polylines along the cubics, broken where the boundary could not be followed."""
    return [
        draw_curve(part, closed and len(parts) == 1, vertices, pieces, nodes.inside[chain[len(chain) // 2]], tol)
        for chain, closed in list_chains(follower)
        for parts in [walk_pieces(chain, closed, pieces)]
        for part in parts
    ]


def walk_pieces(chain: Array, closed: bool, pieces: dict[int, tuple[int, float]]) -> list[list[int]]:
    """The vertices along a chain of nodes, as one list for each unbroken part."""
    parts, current, node = list[list[int]](), [int(chain[0])], int(chain[0])
    last = int(chain[0]) if closed else int(chain[-1])
    while node in pieces:
        node, off = pieces[node]
        if np.isfinite(off):
            current.append(node)
        else:
            parts, current = [*parts, current], [node]
        if node == last:
            break
    return [part for part in (*parts, current) if len(part) > 1]


def draw_curve(
    part: list[int], closed: bool, vertices: Vertices, pieces: dict[int, tuple[int, float]], inside: Array, tol: float
) -> Curve:
    """Points on the cubics, as close as the wanted error asks of a polyline; errors of the vertices and of the cubics together."""
    index = np.array(part)
    first, second = vertices.at(index[:-1]), vertices.at(index[1:])
    off = np.array([pieces[k][1] for k in part[:-1]])
    turn = np.linalg.norm(second.directions - first.directions, axis=1)
    length = np.linalg.norm(second.points - first.points, axis=1)
    counts = np.clip(np.ceil(np.sqrt(turn * length / (4 * tol))), 1, 400).astype(int)
    points, errors = [], []
    for k, count in enumerate(counts):
        share = np.arange(count) / count
        points.append(place_cubic(first.at(np.array([k])), second.at(np.array([k])), share)[0])
        errors.append(np.maximum(first.errors[k], second.errors[k]) + 2 * off[k] * (share > 0) + tol / 4 * (count > 1))
    points.append(second.points[-1:])
    errors.append(second.errors[-1:])
    return Curve(np.clip(np.concatenate(points), 0.0, 1.0), np.concatenate(errors), closed, inside)
