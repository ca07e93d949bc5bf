"""The boundary through a box: crossings of lattice lines, links through cells, cubics along the links, and smaller boxes at the tips."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.follow import STEP, Vertices, find_directions, join_vertices, refine_pieces
from flexlin.periodic.boundary.islands import find_islands
from flexlin.periodic.boundary.lattice import Nodes, add_narrow_tongues, add_quiet_strips, find_nodes, lay_lines
from flexlin.periodic.boundary.links import find_cells, link_nodes
from flexlin.periodic.boundary.spectra import SpectraFunction
from flexlin.periodic.boundary.tips import Tip, find_tip

EXACT = 8.0
"""Points of the boundary are placed to this part of the wanted error."""
INNER = 4
"""Cells on either side of a box that is divided again."""
SMALLEST = 2e-3
"""Boxes smaller than this part of the ranges are searched for a tongue's tip before they are divided."""
TINY = 4.0
"""Boxes smaller than so many wanted errors are crossed straight."""
JOINED = 1e-2
"""Of a box's size: crossings of its border this close, found from inside and from outside, are one."""


@dataclass(frozen=True)
class Box:
    """A rectangle in the unit square and how many cells its lattice has on either side."""

    low: tuple[float, float]
    high: tuple[float, float]
    cells: int

    @property
    def size(self) -> float:
        return max(self.high[0] - self.low[0], self.high[1] - self.low[1])

    def lines(self) -> tuple[Array, Array]:
        """The places of the lattice lines along x and along y."""
        return np.linspace(self.low[0], self.high[0], self.cells + 1), np.linspace(
            self.low[1], self.high[1], self.cells + 1
        )


@dataclass(frozen=True)
class Trace:
    """Vertices of the boundary; for each the one that follows (-1: none), how far the boundary lay off the cubic between them,
    and an unstable point nearby (V, 2), not a number where none is known."""

    vertices: Vertices
    follower: Array
    off: Array
    inside: Array


def trace_box(box: Box, function: SpectraFunction, tol: float, narrow: bool, top: bool = True) -> Trace:
    """Follow the boundary through a box; parts that could not be followed are left out.

    Parameters: narrow: whether to look for tongues between lattice points; top: whether to look for islands.
    """
    xs, ys = box.lines()
    spectra = function(np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2))
    if top:
        xs, ys, spectra = find_islands(xs, ys, spectra, function)
    lines = add_quiet_strips(lay_lines(xs, ys, spectra), function, tol / EXACT)
    if narrow:
        lines = add_narrow_tongues(lines, function, tol / EXACT)
    nodes, step = find_nodes(lines, xs, ys, function, tol / EXACT), min(STEP, STEP * 30 * box.size)
    directions = find_directions(nodes.points, nodes.angle, nodes.undamped, function, step)
    vertices = Vertices(nodes.points, directions, nodes.error, nodes.angle, nodes.undamped)
    next_node = link_nodes(nodes, directions, (len(xs), len(ys)))
    linked = np.flatnonzero(next_node >= 0)
    pairs = np.stack([linked, next_node[linked]], axis=1)
    vertices, follower, off = refine_pieces(vertices, pairs, function, tol, step)
    inside = np.full(vertices.points.shape, np.nan)
    inside[: len(nodes)] = nodes.inside
    trace = Trace(vertices, follower, off, inside)
    return divide_cells(trace, nodes, next_node, (xs, ys), function, tol, narrow)


def divide_cells(
    trace: Trace,
    nodes: Nodes,
    next_node: Array,
    lines: tuple[Array, Array],
    function: SpectraFunction,
    tol: float,
    narrow: bool,
) -> Trace:
    """Trace those cells again, on a lattice of their own, through which a piece could not be followed."""
    xs, ys = lines
    entered, _ = find_cells(nodes, (len(xs), len(ys)))
    broken = [node for node in np.flatnonzero(next_node >= 0).tolist() if not is_followed(node, next_node[node], trace)]
    for i, j in np.unique(entered[broken], axis=0) if broken else ():
        box = Box((xs[i], ys[j]), (xs[i + 1], ys[j + 1]), INNER)
        through = np.flatnonzero((next_node >= 0) & (entered == (i, j)).all(axis=1))
        follower = trace.follower.copy()
        for node in through.tolist():
            cut_pieces(node, next_node[node], follower)
        trace = Trace(trace.vertices, follower, trace.off, trace.inside)
        closed = (
            None
            if box.size > SMALLEST
            else close_tip(trace, box, np.stack([through, next_node[through]], axis=1), function, tol)
        )
        if closed is None:
            inner = trace_box(box, function, tol, narrow, top=False)
            closed = join_traces(trace, inner, through, next_node[through], JOINED * box.size)
        trace = closed
    return trace


def close_tip(trace: Trace, box: Box, pairs: Array, function: SpectraFunction, tol: float) -> Trace | None:
    """The trace with the pairs (P, 2) of nodes on a small box's border joined through the tip inside; none where no tip is there.

    In a box as small as the wanted error they are joined straight.
    """
    vertices = trace.vertices
    if box.size <= TINY * tol:
        follower, off = trace.follower.copy(), trace.off.copy()
        follower[pairs[:, 0]], off[pairs[:, 0]] = pairs[:, 1], box.size
        return Trace(vertices, follower, off, trace.inside)
    first = pairs[0, 0]
    tip = find_tip(box.low, box.high, float(vertices.angles[first]), bool(vertices.undamped[first]), function, tol)
    return None if tip is None else join_through(trace, pairs, tip)


def join_through(trace: Trace, pairs: Array, tip: Tip) -> Trace:
    """The trace with each pair (P, 2) of nodes joined by two parabolas that end in a tip; each counts as wrong by what it bends."""
    count, coming, going = len(trace.follower), pairs[:, 0], pairs[:, 1]
    every, directions, bends = trace.vertices, [], []
    for nodes, way in ((coming, 1.0), (going, -1.0)):
        chord = way * (tip.point - every.points[nodes])
        length = np.linalg.norm(chord, axis=1)
        unit = chord / np.maximum(length, 1e-300)[:, None]
        directions.append(2 * unit - every.directions[nodes])
        bends.append(length * np.linalg.norm(unit - every.directions[nodes], axis=1) ** 2)
    more = Vertices(
        np.tile(tip.point, (2 * len(pairs), 1)),
        np.concatenate(directions),
        np.full(2 * len(pairs), tip.error),
        np.concatenate([every.angles[coming], every.angles[going]]),
        np.concatenate([every.undamped[coming], every.undamped[going]]),
    )
    arrive, leave = count + np.arange(len(pairs)), count + len(pairs) + np.arange(len(pairs))
    follower = np.concatenate([trace.follower, leave, going])
    follower[coming] = arrive
    off = np.concatenate([trace.off, np.zeros(len(pairs)), bends[1]])
    off[coming] = bends[0]
    inside = np.concatenate([trace.inside, np.full((2 * len(pairs), 2), np.nan)])
    return Trace(join_vertices(every, more), follower, off, inside)


def is_followed(node: int, last: int, trace: Trace) -> bool:
    """Whether every piece from one node to the next has met the boundary."""
    while node != last:
        if trace.follower[node] < 0 or not np.isfinite(trace.off[node]):
            return False
        node = int(trace.follower[node])
    return True


def cut_pieces(node: int, last: int, follower: Array) -> None:
    """Take out all pieces from one node to the next."""
    while node >= 0 and node != last:
        follower[node], node = -1, int(follower[node])


def join_traces(outer: Trace, inner: Trace, coming: Array, going: Array, near: float) -> Trace:
    """Both traces, joined where the ends of the inner one lie on the outer one's nodes."""
    count = len(outer.follower)
    follower = np.concatenate([outer.follower, np.where(inner.follower >= 0, inner.follower + count, -1)])
    starts = count + np.setdiff1d(np.arange(len(inner.follower)), inner.follower)
    ends = count + np.flatnonzero(inner.follower < 0)
    vertices = join_vertices(outer.vertices, inner.vertices)
    for node in coming:
        partner = find_nearest(vertices.points, node, starts, near)
        if partner is not None:
            follower[node] = partner
    for node in going:
        partner = find_nearest(vertices.points, node, ends, near)
        if partner is not None:
            follower[partner] = node
    off, inside = np.concatenate([outer.off, inner.off]), np.concatenate([outer.inside, inner.inside])
    off[[*coming, *ends]] = 0.0
    return Trace(vertices, follower, off, inside)


def find_nearest(points: Array, node: int, others: Array, near: float) -> int | None:
    """The nearest of some vertices to a node, none where it is farther than `near`."""
    if not len(others):
        return None
    apart = np.linalg.norm(points[others] - points[node], axis=1)
    return int(others[apart.argmin()]) if apart.min() <= near else None
