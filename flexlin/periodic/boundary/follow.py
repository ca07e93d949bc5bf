"""The boundary between two of its points: cubic pieces, halved until the boundary's own middle agrees with them."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.roots import SignedEnds, solve_brackets
from flexlin.periodic.boundary.spectra import SpectraFunction, measure_margins

STEP = 3e-5
"""Of the ranges: the step of the differences that give the margin's gradient, whose only use is the direction of the boundary."""
FIRST, WIDER, TRIES = 1e-4, 8.0, 6
"""How far from a piece's middle the boundary is looked for first, in lengths of the piece, and how often farther."""
DEEPEST = 24


@dataclass(frozen=True)
class Vertices:
    """Points (V, 2) of the boundary in the unit square: direction (V, 2) with the unstable side on the left, error (V,), and the margin
    by which they were found: angle of the growing multiplier and whether it is undamped."""

    points: Array
    directions: Array
    errors: Array
    angles: Array
    undamped: Array

    def at(self, which: Array) -> "Vertices":
        """Some of the vertices."""
        return Vertices(*(getattr(self, name)[which] for name in Vertices.__annotations__))


def find_directions(points: Array, angles: Array, undamped: Array, function: SpectraFunction) -> tuple[Array, Array]:
    """Unit tangents (V, 2) of the boundary, unstable side on the left, and the margin's slope across it (V,), by central differences."""
    moves = STEP * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    places = np.clip(points[None] + moves[:, None], 0.0, 1.0)
    spectra = function(places.reshape(-1, 2))
    margin = measure_margins(spectra, np.tile(undamped, 4), np.tile(angles, 4))[0].reshape(4, -1)
    gradient = np.stack(
        [
            (margin[0] - margin[1]) / (places[0, :, 0] - places[1, :, 0]),
            (margin[2] - margin[3]) / (places[2, :, 1] - places[3, :, 1]),
        ],
        axis=1,
    )
    size = np.linalg.norm(gradient, axis=1)
    tangents = np.stack([gradient[:, 1], -gradient[:, 0]], axis=1)
    return tangents / np.maximum(size, 1e-300)[:, None], size


def cubic_middle(first: Vertices, second: Vertices) -> tuple[Array, Array, Array]:
    """Middle (V, 2) of the cubic through two vertices with their directions, the normal there towards the unstable side, and the chords (V,)."""
    chord = second.points - first.points
    length = np.linalg.norm(chord, axis=1)
    middle = (first.points + second.points) / 2 + length[:, None] / 8 * (first.directions - second.directions)
    along = 1.5 * chord - length[:, None] / 4 * (first.directions + second.directions)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-300)[:, None]
    return middle, np.stack([-along[:, 1], along[:, 0]], axis=1), length


def place_cubic(first: Vertices, second: Vertices, share: Array) -> Array:
    """Points (V, S, 2) at shares (S,) of the cubics."""
    length = np.linalg.norm(second.points - first.points, axis=1)[:, None, None]
    s = share[None, :, None]
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * first.points[:, None]
        + s**2 * (3 - 2 * s) * second.points[:, None]
        + length * s * (1 - s) * ((1 - s) * first.directions[:, None] - s * second.directions[:, None])
    )


def find_middles(first: Vertices, second: Vertices, function: SpectraFunction, accuracy: float) -> tuple[Vertices, Array]:
    """Points of the boundary on the normals of the cubics' middles, and how far off they lie (V,); infinite where none was met."""
    middle, normal, length = cubic_middle(first, second)
    undamped = first.undamped & second.undamped
    angles = np.angle(np.exp(1j * first.angles) + np.exp(1j * second.angles))
    near = np.abs(np.abs(first.angles) + np.abs(second.angles) - 2 * np.pi) < 0.2
    angles = np.where(near, first.angles, angles)

    def margin(which: Array, offsets: Array) -> tuple[Array, Array]:
        places = np.clip(middle[which] + offsets[:, None] * normal[which], 0.0, 1.0)
        return measure_margins(function(places), undamped[which], angles[which])

    every = np.arange(len(middle))
    here = margin(every, np.zeros(len(middle)))[0]
    way = np.where(here > 0, -1.0, 1.0)
    outer, there, searching = np.zeros(len(middle)), here.copy(), here != 0
    for k in range(TRIES):
        which = np.flatnonzero(searching)
        if not len(which):
            break
        outer[which] = way[which] * np.minimum(FIRST * WIDER**k, 1.5) * length[which]
        there[which] = margin(which, outer[which])[0]
        searching[which] = np.sign(there[which]) == np.sign(here[which])
    met = ~searching
    which = np.flatnonzero(met)
    start = SignedEnds(np.zeros(len(which)), outer[which], here[which], there[which])
    ends = solve_brackets(lambda k, x: margin(which[k], x)[0], start, accuracy)
    offset = np.zeros(len(middle))
    offset[which] = ends.best
    points = np.clip(middle + offset[:, None] * normal, 0.0, 1.0)
    error = np.zeros(len(middle))
    left, uncertain = margin(which, offset[which])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.abs((start.at_b - start.at_a) / (start.b - start.a))
        error[which] = np.minimum((np.abs(left) + uncertain) / slope, np.abs(start.b)) + ends.width / 2
    error = np.nan_to_num(error, nan=0.0, posinf=0.0)
    found = Vertices(points, np.zeros_like(points), error, angles, undamped)
    return found, np.where(met, np.abs(offset), np.inf)


@dataclass
class Piece:
    """A cubic between two vertices, and how far the boundary's middle lay off it."""

    first: int
    second: int
    off: float = 0.0


def refine_pieces(
    vertices: Vertices, pairs: Array, function: SpectraFunction, tol: float
) -> tuple[Vertices, dict[int, tuple[int, float]]]:
    """Halve the pieces between pairs (P, 2) of vertices until the boundary's middle lies within tol / 2 of each cubic.

    Returns: all vertices; for each that begins a piece, the one that follows it and how far the boundary lay off (inf: not followed).
    """
    follower: dict[int, tuple[int, float]] = {}
    for _ in range(DEEPEST):
        if not len(pairs):
            break
        first, second = vertices.at(pairs[:, 0]), vertices.at(pairs[:, 1])
        found, off = find_middles(first, second, function, tol / 50)
        length = np.linalg.norm(second.points - first.points, axis=1)
        done = (off <= tol / 2) | (length <= tol) | ~np.isfinite(off)
        for (a, b), distance, size in zip(pairs[done], off[done], length[done], strict=True):
            follower[int(a)] = (int(b), float(min(distance, size) if size <= tol else distance))
        new = found.at(~done)
        directions = find_directions(new.points, new.angles, new.undamped, function)[0] if len(new.points) else new.directions
        count = len(vertices.points)
        vertices = join_vertices(vertices, Vertices(new.points, directions, new.errors, new.angles, new.undamped))
        fresh = np.arange(count, len(vertices.points))
        open_ = pairs[~done]
        pairs = np.concatenate([np.stack([open_[:, 0], fresh], axis=1), np.stack([fresh, open_[:, 1]], axis=1)])
    return vertices, follower


def join_vertices(some: Vertices, more: Vertices) -> Vertices:
    """Both sets, one behind the other."""
    return Vertices(*(np.concatenate([getattr(some, name), getattr(more, name)]) for name in Vertices.__annotations__))
