"""All curves in a rectangle of two parameters at which a periodic system becomes unstable, and the tips where two of them meet."""

from dataclasses import dataclass, replace
from operator import itemgetter

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
    find_middles,
    find_nodes,
    link_nodes,
    measure_chords,
    measure_quarters,
    place_cubic,
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
from flexlin.precision import CUBE_ROOT_EPS

INNER_CELLS = 4
"""Cells on either side of a cell that is divided again."""
SMALLEST_BOX = 2e-3
"""Boxes smaller than this part of the ranges are searched for a tongue's tip before they are divided."""
MARGIN_DEGREE = 5
"""Of the polynomials through the margin on a box, along either side."""


Tip = tuple[float, Array]
"""How far from the point where two sides of the boundary meet they may part, and the point, (2,)."""


@dataclass(frozen=True)
class Curve:
    """A piece of the boundary in the unit square: points (N, 2), their errors (N,), whether it is closed, and an unstable point nearby."""

    points: Array
    errors: Array
    closed: bool
    inside: Array


Piece = tuple[int, int, float]
"""Two vertices, one behind the other, and how far the boundary lay off the cubic between them: infinite where it was not met."""


class Tracer:
    """What follows the boundary through boxes: spectra, wanted distance, whether tongues between lattice points are looked for, and the
    effort, at whose end cells through which the boundary could not be followed at once stay open; all vertices that were found."""

    def __init__(self, function: SpectraFunction, tol: float, narrow: bool, effort: Effort):
        self.function, self.tol, self.narrow, self.effort = function, tol, narrow, effort
        nowhere, nothing = np.empty((0, 2)), np.empty(0)
        self.vertices = Vertices(nowhere, nowhere, nothing, nothing, nothing > 0, nowhere)

    def add(self, more: Vertices) -> Array:
        """The places of further vertices among all."""
        first = len(self.vertices.points)
        self.vertices = self.vertices.beside(more)
        return np.arange(first, len(self.vertices.points))

    def trace(self, low: Array, high: Array, cells: int) -> list[Piece]:
        """Follow the boundary through a box of the unit square; parts that could not be followed are left out.

        Crossings of lattice lines are linked through the cells and joined by cubics.
        """
        xs, ys = (np.linspace(a, b, cells + 1) for a, b in zip(low, high, strict=True))
        spectra, whole = self.function(spread(xs, ys)), low.max() == 0.0 and high.min() == 1.0
        if whole:
            xs, ys, spectra = find_islands(xs, ys, spectra, self.function)
        found, entered, left = find_nodes(xs, ys, spectra, self.function, self.tol / EXACT_PARTS, self.narrow)
        step = GRADIENT_STEP * min(1.0, CELLS * float((high - low).max()))
        found = find_directions(found, self.function, step)
        following = link_nodes(found, entered, left)
        linked = np.flatnonzero(following >= 0)
        pairs, cell = self.add(found)[np.stack([linked, following[linked]], axis=1)], entered[linked]
        links = self.refine(pairs, step)
        broken = [not np.isfinite([off for *_, off in link]).all() for link in links]
        for i, j in np.unique(cell[broken], axis=0):
            if not self.effort.affords(0):
                self.effort.unfinished = True
                break
            through = np.flatnonzero((cell == (i, j)).all(axis=1))
            for k in through:
                links[k] = []
            links.append(self.divide(pairs[through], np.array([xs[i], ys[j]]), np.array([xs[i + 1], ys[j + 1]])))
        return [piece for link in links for piece in link if np.isfinite(piece[2])]

    def refine(self, pairs: Array, step: float) -> list[list[Piece]]:
        """The pieces between pairs (P, 2) of vertices, for each as many as it takes: they are halved until each cubic lies within tol / 4
        of the boundary at middle and quarter, or the effort ends: twice that, the chords and a vertex stay below tol together."""
        links, owner = [list[Piece]() for _ in pairs], np.arange(len(pairs))
        while len(pairs):
            first, second = (self.vertices.at(ends) for ends in pairs.T)
            found, off, slope = find_middles(first, second, self.function, self.tol / EXACT_PARTS)
            length = np.linalg.norm(second.points - first.points, axis=1)
            short = length <= np.maximum(self.tol, EXACT_PARTS * np.maximum(first.errors, second.errors))
            near = np.flatnonzero((off <= self.tol / 4) & ~short)
            quarters = measure_quarters(first.at(near), second.at(near), found.at(near), slope[near], self.function)
            off[near] = np.maximum(off[near], quarters)
            done = (off <= self.tol / 4) | short | ~np.isfinite(off)
            if not self.effort.affords(0):
                self.effort.unfinished |= not done.all()
                off[~done] *= EXACT_PARTS  # between an end and the middle of such a piece nobody looked
                done = np.full(len(pairs), True)
            off = np.where(short, np.minimum(off, length), off)
            for k in np.flatnonzero(done):
                links[owner[k]].append((int(pairs[k, 0]), int(pairs[k, 1]), float(off[k])))
            first, last = pairs[~done].T
            middle = self.add(find_directions(found.at(~done), self.function, step))
            pairs = np.concatenate([np.stack([first, middle], axis=1), np.stack([middle, last], axis=1)])
            owner = np.tile(owner[~done], 2)
        return links

    def divide(self, pairs: Array, low: Array, high: Array) -> list[Piece]:
        """Join the pairs (P, 2) of nodes on a cell's border anew: through a tongue's tip in it, or on a lattice of its own.

        In a cell as small as the wanted error they are joined straight.
        """
        size = float((high - low).max())
        if size <= self.tol * EXACT_PARTS / 2:
            return [(node, last, size) for node, last in pairs.tolist()]
        of = self.vertices.at(pairs[:1, 0])
        tip = find_tip(low, high, of.angles, of.undamped, self.function, self.tol) if size <= SMALLEST_BOX else None
        return self.join_inside(pairs, low, high) if tip is None else self.join_through(pairs, tip)

    def join_inside(self, pairs: Array, low: Array, high: Array) -> list[Piece]:
        """The boundary through a box, joined where its ends lie on the pairs (P, 2) of nodes."""
        before = len(self.vertices.points)
        pieces = self.trace(low, high, INNER_CELLS)
        points = self.vertices.points
        inner, joints = np.arange(before, len(points)), list[Piece]()
        starts, ends = (np.setdiff1d(inner, [piece[side] for piece in pieces]) for side in (1, 0))
        for nodes, others in ((pairs[:, 0], starts), (pairs[:, 1], ends)):
            for node in nodes if len(others) else ():
                apart = np.linalg.norm(points[others] - points[node], axis=1)
                partner = int(others[apart.argmin()])
                if apart.min() <= self.tol:
                    joints.append((int(node), partner, 0.0) if others is starts else (partner, int(node), 0.0))
        return pieces + joints

    def join_through(self, pairs: Array, tip: Tip) -> list[Piece]:
        """The pairs (P, 2) of nodes joined by two parabolas each that end in a tip; each counts as wrong by what it bends."""
        error, point = tip
        ends = self.vertices.at(pairs.ravel())
        sides = np.tile([1.0, -1.0], len(pairs))  # it comes from one, goes to the next
        length, unit = measure_chords(ends.points, point)
        unit *= sides[:, None]
        bends = length * np.linalg.norm(unit - ends.directions, axis=1) ** 2
        there, errors = np.tile(point, (len(sides), 1)), np.full(len(sides), error)
        tips = self.add(replace(ends, points=there, directions=2 * unit - ends.directions, errors=errors))
        pieces = list[Piece]()
        for (node, last), (arrive, leave), (before, behind) in zip(
            pairs.tolist(), tips.reshape(-1, 2).tolist(), bends.reshape(-1, 2).tolist(), strict=True
        ):
            pieces += [(node, arrive, before), (arrive, leave, 0.0), (leave, last, behind)]
        return pieces


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

    tracer = Tracer(moving, tol, not constant, effort or Effort())
    chains = list_chains(tracer.trace(np.zeros(2), np.ones(2), cells))
    curves = [draw_curve(chain, tracer.vertices, tol) for chain in chains]
    return [curve for curve in curves if np.ptp(curve.points, axis=0).max() > SMALLEST_BOX]


def find_lost_ends(curves: list[Curve]) -> list[Array]:
    """Ends (K, 2) of each curve inside the unit square where no other one goes on: the boundary does, and was not met there."""
    ends = np.array([curve.points[k] for curve in curves for k in (0, -1)]).reshape(-1, 2)
    apart = np.linalg.norm(ends[:, None] - ends, axis=2)
    apart[np.diag_indices(len(ends))] = np.inf
    inside = np.minimum(ends, 1 - ends).min(axis=1) > CUBE_ROOT_EPS
    lost = (inside & (apart.min(axis=1, initial=np.inf) > SMALLEST_BOX)).reshape(-1, 2)
    return [ends[2 * k : 2 * k + 2][lost[k]] for k in range(len(curves))]


def list_chains(pieces: list[Piece]) -> list[list[Piece]]:
    """The curves as pieces in order; a closed one ends where it begins."""
    left = {piece[0]: piece for piece in sorted(pieces)}
    begun = left.keys() - {last for _, last, _ in pieces}
    chains = []
    for node in (*sorted(begun), *left):
        chain = list[Piece]()
        while node in left:
            chain.append(left.pop(node))
            node = chain[-1][1]
        chains.append(chain)
    return [chain for chain in chains if chain]


def draw_curve(chain: list[Piece], vertices: Vertices, tol: float) -> Curve:
    """Points on the cubics, of which no chord is farther away than tol / 4; errors of the vertices and of the cubics together."""
    begin, end, off = map(np.array, zip(*chain, strict=True))
    first, second = vertices.at(begin), vertices.at(end)
    length, unit = measure_chords(first.points, second.points)
    turn = np.linalg.norm(first.directions - unit, axis=1) + np.linalg.norm(second.directions - unit, axis=1)
    counts = np.where(length > 0, np.maximum(np.ceil(np.sqrt(turn * length / (2 * tol))), 1), 1).astype(int)  # chords
    piece = np.repeat(np.arange(len(counts)), counts)
    share = divide_evenly(np.arange(len(counts) + 1.0), counts)[:-1] - piece
    points = place_cubic(first.at(piece), second.at(piece), share[:, None])[:, 0]
    between = np.where(share > 0, 2 * off[piece] + tol / 4, 0.0)
    errors = np.maximum(first.errors, second.errors)[piece] + between
    inside = second.inside[(len(chain) - 1) // 2]
    points, errors = np.append(points, second.points[-1:], axis=0), np.append(errors, second.errors[-1])
    return Curve(np.clip(points, 0.0, 1.0), errors, bool(begin[0] == end[-1]), inside)


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
        close = list[Tip]()
        for side in sides:
            point, bend = find_critical(margin, side)
            if np.abs(point).max() <= 1 + CUBE_ROOT_EPS and bend > 0:
                left = abs(float(value_of(margin, point))) + tail
                apart = float(np.sqrt(2 * (left + rounding) / bend) * (high - low).max() / 2)
                if left <= EXACT_PARTS * rounding or apart <= tol:
                    close.append((apart, np.clip((low + high) / 2 + point * (high - low) / 2, 0.0, 1.0)))
        if close:
            return min(close, key=itemgetter(0))
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
