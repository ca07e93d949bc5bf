"""All curves in a rectangle of two parameters at which a periodic system becomes unstable, and the tips where two of them meet."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import chebyshev

from flexlin.checks import Array
from flexlin.periodic.boundary.crossings import CELLS
from flexlin.periodic.boundary.follow import (
    EXACT_PARTS,
    GRADIENT_STEP,
    Vertices,
    find_directions,
    find_islands,
    find_nodes,
    link_nodes,
    place_cubic,
    refine_pieces,
    spread,
)
from flexlin.periodic.boundary.spectra import (
    Effort,
    Spectra,
    SpectraFunction,
    count_resting,
    drop_resting,
    measure_margins,
)
from flexlin.periodic.interpolation import NODES, chebyshev_nodes, divide_evenly
from flexlin.precision import CUBE_ROOT_EPS, TINY

INNER_CELLS = 4
"""Cells on either side of a cell that is divided again."""
SMALLEST_BOX = 2e-3
"""Boxes smaller than this part of the ranges are searched for a tongue's tip before they are divided."""
MARGIN_DEGREE = 5
"""Of the polynomials through the margin on a box, along either side."""


@dataclass(frozen=True)
class Tip:
    """Where two sides of the boundary meet, (2,), how far from it they may part, and whether the margin there is zero but for rounding."""

    point: Array
    error: float
    zero: bool


@dataclass(frozen=True)
class Curve:
    """A piece of the boundary in the unit square: points (N, 2), their errors (N,), whether it is closed, and an unstable point nearby."""

    points: Array
    errors: Array
    closed: bool
    inside: Array


@dataclass(frozen=True)
class Trace:
    """Vertices of the boundary; for each the one that follows (-1: none), and how far the boundary lay off the cubic between them."""

    vertices: Vertices
    follower: Array
    off: Array

    def passes(self, node: int, last: int) -> list[int]:
        """The vertices from one node to before another, as far as they are joined."""
        passed = list[int]()
        while node not in (-1, last):
            passed.append(node)
            node = int(self.follower[node])
        return passed

    def is_followed(self, node: int, last: int) -> bool:
        """Whether every piece from one node to another has met the boundary."""
        passed = self.passes(node, last)
        return self.follower[passed[-1]] == last and bool(np.isfinite(self.off[passed]).all())


@dataclass(frozen=True)
class Tracer:
    """What follows the boundary through boxes: spectra, wanted distance, whether tongues between lattice points are looked for, and the
    effort, at whose end cells through which the boundary could not be followed at once stay open."""

    function: SpectraFunction
    tol: float
    narrow: bool
    effort: Effort

    def trace(self, low: Array, high: Array, cells: int) -> Trace:
        """Follow the boundary through a box of the unit square; parts that could not be followed are left out.

        Crossings of lattice lines are linked through the cells and joined by cubics.
        """
        xs, ys = (np.linspace(a, b, cells + 1) for a, b in zip(low, high, strict=True))
        spectra, whole = self.function(spread(xs, ys)), low.max() == 0.0 and high.min() == 1.0
        if whole:
            xs, ys, spectra = find_islands(xs, ys, spectra, self.function)
        nodes, entered, left = find_nodes(xs, ys, spectra, self.function, self.tol / EXACT_PARTS, self.narrow)
        size = float((high - low).max())
        step = GRADIENT_STEP * min(1.0, CELLS * size)
        directions = find_directions(nodes.points, nodes.angles, nodes.undamped, self.function, step)
        nodes = replace(nodes, directions=directions)
        following = link_nodes(nodes, entered, left)
        linked = np.flatnonzero(following >= 0)
        pairs = np.stack([linked, following[linked]], axis=1)
        trace = Trace(*refine_pieces(nodes, pairs, self.function, self.tol, step, self.effort))
        broken = [node for node, last in pairs.tolist() if not trace.is_followed(node, last)]
        for i, j in np.unique(entered[broken], axis=0) if broken else ():
            if not self.effort.affords(0):
                self.effort.unfinished = True
                return replace(trace, follower=np.where(np.isfinite(trace.off), trace.follower, -1))
            through = pairs[(entered[pairs[:, 0]] == (i, j)).all(axis=1)]
            trace = self.divide(trace, through, np.array([xs[i], ys[j]]), np.array([xs[i + 1], ys[j + 1]]))
        return trace

    def divide(self, trace: Trace, pairs: Array, low: Array, high: Array) -> Trace:
        """Join the pairs (P, 2) of nodes on a cell's border anew: through a tongue's tip in it, or on a lattice of its own.

        In a cell as small as the wanted error they are joined straight.
        """
        follower, off, size = trace.follower.copy(), trace.off.copy(), float((high - low).max())
        for node, last in pairs.tolist():
            follower[trace.passes(node, last)] = -1
        if size <= self.tol * EXACT_PARTS / 2:
            follower[pairs[:, 0]], off[pairs[:, 0]] = pairs[:, 1], size
            return Trace(trace.vertices, follower, off)
        trace = Trace(trace.vertices, follower, off)
        if size <= SMALLEST_BOX:
            first = trace.vertices.at(pairs[:1, 0])
            tip = find_tip(low, high, first.angles, first.undamped, self.function, self.tol)
            if tip is not None:
                return join_through(trace, pairs, tip)
        return join_traces(trace, self.trace(low, high, INNER_CELLS), pairs, self.tol)


def find_curves(
    function: SpectraFunction, tol: float, cells: int = CELLS, constant: bool = False, effort: Effort | None = None
) -> list[Curve]:
    """The curves along which the largest growth passes zero, with the unstable side on their left.

    Spectra on the lines of a lattice give the points at which the boundary crosses them; through each cell, points are joined by cubics
    whose middles are compared with the boundary itself and which are halved until they agree. A cell through which the boundary cannot
    be followed that way, at the tip of a tongue, is divided again, until both sides meet there to within rounding (`find_tip`).

    Parameters: function: points (V, 2) of the unit square -> spectra; tol: wanted distance from the exact boundary;
    constant: whether A does not depend on time, so that multipliers may meet without any effect; effort: ends the search.
    """
    some = function(np.random.default_rng(0).random((8, 2)))
    resting = count_resting(some)
    if resting == some.logs.shape[1]:
        return []

    def moving(points: Array) -> Spectra:
        return drop_resting(function(points), resting)

    trace = Tracer(moving, tol, not constant, effort or Effort()).trace(np.zeros(2), np.ones(2), cells)
    curves = [draw_curve(chain, trace, tol) for chain in list_chains(trace.follower)]
    return [curve for curve in curves if np.ptp(curve.points, axis=0).max() > SMALLEST_BOX]


def find_lost_ends(curves: list[Curve]) -> list[Array]:
    """Ends (K, 2) of each curve inside the unit square where no other one goes on: the boundary does, and was not met there."""
    ends = np.array([curve.points[k] for curve in curves for k in (0, -1)]).reshape(-1, 2)
    apart = np.linalg.norm(ends[:, None] - ends, axis=2)
    apart[np.diag_indices(len(ends))] = np.inf
    inside = np.minimum(ends, 1 - ends).min(axis=1) > CUBE_ROOT_EPS
    lost = (inside & (apart.min(axis=1, initial=np.inf) > SMALLEST_BOX)).reshape(-1, 2)
    return [ends[2 * k : 2 * k + 2][lost[k]] for k in range(len(curves))]


def join_through(trace: Trace, pairs: Array, tip: Tip) -> Trace:
    """The trace with each pair (P, 2) of nodes joined by two parabolas that end in a tip; each counts as wrong by what it bends."""
    count, size = len(trace.follower), len(pairs)
    ends = trace.vertices.at(pairs.T.ravel())  # where the boundary comes from, then where it goes to
    chord = (tip.point - ends.points) * np.repeat([1.0, -1.0], size)[:, None]
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.maximum(length, TINY)[:, None]
    bends = length * np.linalg.norm(unit - ends.directions, axis=1) ** 2
    more = replace(
        ends,
        points=np.tile(tip.point, (2 * size, 1)),
        directions=2 * unit - ends.directions,
        errors=np.full(2 * size, tip.error),
    )
    arrive, leave = count + np.arange(size), count + size + np.arange(size)
    follower, off = np.concatenate([trace.follower, leave, pairs[:, 1]]), np.append(trace.off, 0.0 * bends)
    follower[pairs[:, 0]] = arrive
    off[pairs[:, 0]], off[leave] = bends[:size], bends[size:]
    return Trace(trace.vertices.beside(more), follower, off)


def join_traces(outer: Trace, inner: Trace, pairs: Array, near: float) -> Trace:
    """Both traces, joined where the ends of the inner one lie on the outer one's nodes."""
    count = len(outer.follower)
    follower = np.concatenate([outer.follower, np.where(inner.follower >= 0, inner.follower + count, -1)])
    off, points = np.concatenate([outer.off, inner.off]), inner.vertices.points
    starts, ends = np.setdiff1d(np.arange(len(points)), inner.follower), np.flatnonzero(inner.follower < 0)
    off[[*pairs[:, 0], *(count + ends)]] = 0.0
    for column, others in enumerate((starts, ends)):
        for node in pairs[:, column] if len(others) else ():
            apart = np.linalg.norm(points[others] - outer.vertices.points[node], axis=1)
            partner = count + others[apart.argmin()]
            if apart.min() <= near:
                one, next_ = (node, partner) if column == 0 else (partner, node)
                follower[one] = next_
    return Trace(outer.vertices.beside(inner.vertices), follower, off)


def list_chains(follower: Array) -> list[Array]:
    """The curves as vertices in order; a closed one ends where it begins."""
    first = np.setdiff1d(np.arange(len(follower)), follower)
    seen = np.zeros(len(follower), dtype=bool)
    chains = []
    for start in (*first, *range(len(follower))):
        chain, node = list[int](), int(start)
        while node >= 0 and not seen[node]:
            seen[node] = True
            chain.append(node)
            node = int(follower[node])
        if chain:
            chains.append(np.array([*chain, node] if node == chain[0] else chain))
    return [chain for chain in chains if len(chain) > 1]


def draw_curve(chain: Array, trace: Trace, tol: float) -> Curve:
    """Points on the cubics, as close as the wanted error asks of a polyline; errors of the vertices and of the cubics together."""
    first, second = trace.vertices.at(chain[:-1]), trace.vertices.at(chain[1:])
    counts = count_points(first, second, tol)
    piece = np.repeat(np.arange(len(counts)), counts)
    share = divide_evenly(np.arange(len(counts) + 1.0), counts)[:-1] - piece
    points = place_cubic(first.at(piece), second.at(piece), share[:, None])[:, 0]
    between = np.where(share > 0, 2 * trace.off[chain[piece]] + tol / 4, 0.0)
    errors = np.maximum(first.errors, second.errors)[piece] + between
    inside = trace.vertices.inside[chain[len(chain) // 2]]
    points, errors = np.append(points, second.points[-1:], axis=0), np.append(errors, second.errors[-1])
    return Curve(np.clip(points, 0.0, 1.0), errors, bool(chain[0] == chain[-1]), inside)


def count_points(first: Vertices, second: Vertices, tol: float) -> Array:
    """How many chords each cubic needs, so that none is farther from it than tol / 4."""
    chord = second.points - first.points
    length = np.linalg.norm(chord, axis=1)
    unit = chord / np.maximum(length, TINY)[:, None]
    turn = np.linalg.norm(first.directions - unit, axis=1) + np.linalg.norm(second.directions - unit, axis=1)
    return np.where(length > 0, np.maximum(np.ceil(np.sqrt(turn * length / (2 * tol))), 1), 1).astype(int)


def find_tip(
    low: Array, high: Array, angle: Array, undamped: Array, function: SpectraFunction, tol: float
) -> Tip | None:
    """The point of a box at which two sides of the boundary meet to within tol, or to within rounding, if there is one.

        m = 0,  grad m = 0,   or on a border of the unit square  m = 0,  dm/ds = 0   along it

    m: the margin, smooth through the boundary (`measure_margins`), as a polynomial of both coordinates, each from -1 to 1 in the box.
    There the sides part like (2 |m| / |largest eigenvalue of m''|)^(1/2). Borders come first: a flat cusp is critical all along its
    last part.
    Parameters: low, high (2,): of the box; angle, undamped (1,): of the margin.
    Source: Seyranian, Mailybaev, Multiparameter Stability Theory (2003), section 2.9 (singularities of stability boundaries).
    """
    nodes = spread(*2 * [chebyshev.chebpts1(MARGIN_DEGREE + 1)])
    places, count = (low + high) / 2 + nodes * (high - low) / 2, len(nodes)
    values, errors = measure_margins(function(places), np.repeat(undamped, count), np.repeat(angle, count))
    if not (np.isfinite(values).all() and np.isfinite(errors).all()):
        return None
    margin = np.linalg.solve(
        chebyshev.chebvander2d(nodes[:, 0], nodes[:, 1], [MARGIN_DEGREE, MARGIN_DEGREE]), values
    ).reshape(MARGIN_DEGREE + 1, MARGIN_DEGREE + 1)
    tail, rounding = float(np.abs(margin[-1]).sum() + np.abs(margin[:, -1]).sum()), float(np.median(errors))
    borders = [(axis, end) for axis in range(2) for end, at in ((-1, low[axis] <= 0), (1, high[axis] >= 1)) if at]
    for sides in (borders, [None]):
        close = []
        for side in sides:
            point, bend = find_critical(margin, side)
            if np.abs(point).max() <= 1 + CUBE_ROOT_EPS and bend > 0:
                left = abs(float(value_of(margin, point)))
                apart = np.sqrt(2 * (left + rounding + tail) / bend) * (high - low).max() / 2
                place = np.clip((low + high) / 2 + point * (high - low) / 2, 0.0, 1.0)
                close.append(Tip(place, float(apart), left + tail <= EXACT_PARTS * rounding))
        close = [tip for tip in close if tip.zero or tip.error <= tol]
        if close:
            return min(close, key=lambda tip: tip.error)
    return None


def find_critical(margin: Array, side: tuple[int, int] | None) -> tuple[Array, float]:
    """The critical point of a polynomial in its box, or along one side of it, axis `side[0]` at `side[1]`, by Newton's method from the
    flattest point of a grid; and its largest second derivative there."""
    free = [axis for axis in range(2) if side is None or axis != side[0]]
    slopes = [chebyshev.chebder(margin, axis=axis) for axis in range(2)]
    bends = [[chebyshev.chebder(slope, axis=axis) for axis in range(2)] for slope in slopes]
    grid = chebyshev_nodes(NODES)
    points = spread(*(grid if axis in free or side is None else np.array([float(side[1])]) for axis in range(2)))
    steep = np.hypot.reduce([value_of(slopes[axis], points) for axis in free])
    point, hessian = points[steep.argmin()].copy(), np.zeros((len(free), len(free)))
    for _ in range(NODES):
        gradient = np.array([value_of(slopes[axis], point) for axis in free])
        hessian = np.array([[value_of(bends[i][j], point) for i in free] for j in free])
        point[free] = np.clip(point[free] + np.linalg.lstsq(hessian, -gradient, rcond=CUBE_ROOT_EPS)[0], -2.0, 2.0)
    return point, float(np.abs(np.linalg.eigvalsh(hessian)).max())


def value_of(polynomial: Array, points: Array) -> Array:
    """A polynomial of both coordinates at points (..., 2)."""
    return np.asarray(chebyshev.chebval2d(points[..., 0], points[..., 1], polynomial))
