"""The boundary between two of its points: cubic pieces, halved until the boundary's own middle agrees with them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.roots import SignedEnds, solve_brackets
from flexlin.periodic.boundary.spectra import SpectraFunction, measure_margins

STEP = 3e-5
"""Of the ranges: the step of the differences that give the margin's gradient, whose only use is the direction of the boundary.

Exact derivatives cost 170 to 400 times as much as four values of the compiled kernel (13 times with 12 states), and turn it by 1e-5 rad
at the most.
"""
FIRST, WIDER, FARTHEST, TRIES = 1e-4, 8.0, 1.5, 6
"""How far from a piece's middle the boundary is looked for, in lengths of the piece: at first, by which factor farther, at the most."""
DEEPEST = 40
BLURRED = 30.0
"""Pieces shorter than this many errors of their ends are not halved: what bends them is rounding."""


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


def find_directions(
    points: Array, angles: Array, undamped: Array, function: SpectraFunction, step: float = STEP
) -> Array:
    """Unit tangents (V, 2) of the boundary, unstable side on the left, by central differences of the margin."""
    moves = step * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
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
    tangents = np.stack([gradient[:, 1], -gradient[:, 0]], axis=1)
    return np.asarray(tangents / np.maximum(np.linalg.norm(gradient, axis=1), 1e-300)[:, None])


def cubic_middle(first: Vertices, second: Vertices) -> tuple[Array, Array, Array]:
    """Middle (V, 2) of the cubics through two vertices with their directions, normals there towards the unstable side, and chords (V,)."""
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


def find_middles(
    first: Vertices, second: Vertices, function: SpectraFunction, accuracy: float
) -> tuple[Vertices, Array, Array]:
    """Points of the boundary on the normals of the cubics' middles, how far off they lie (V,), infinite where none was met, and the
    margin's slopes there (V,)."""
    middle, normal, length = cubic_middle(first, second)
    undamped, angles = first.undamped & second.undamped, mean_angles(first.angles, second.angles)

    def margin(which: Array, offsets: Array) -> tuple[Array, Array]:
        places = np.clip(middle[which] + offsets[:, None] * normal[which], 0.0, 1.0)
        return measure_margins(function(places), undamped[which], angles[which])

    start = enclose_boundary(lambda which, x: margin(which, x)[0], length)
    met = np.flatnonzero(start.at_a * start.at_b <= 0)
    chosen = SignedEnds(start.a[met], start.b[met], start.at_a[met], start.at_b[met])
    ends = solve_brackets(lambda k, x: margin(met[k], x)[0], chosen, accuracy)
    offset, error, slope = np.full(len(middle), np.inf), np.zeros(len(middle)), np.full(len(middle), 1e-300)
    offset[met] = ends.best
    left, uncertain = margin(met, ends.best)
    reach = np.maximum(np.abs(chosen.b - chosen.a), 1e-300)
    slope[met] = np.maximum(np.abs(chosen.at_b - chosen.at_a) / reach, 1e-300)
    error[met] = np.minimum((np.abs(left) + uncertain) / slope[met], reach) + ends.width / 2
    points = np.clip(middle + np.where(np.isfinite(offset), offset, 0.0)[:, None] * normal, 0.0, 1.0)
    return Vertices(points, np.zeros_like(points), error, angles, undamped), np.abs(offset), slope


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


def mean_angles(first: Array, second: Array) -> Array:
    """Half-way between angles on the circle; the first where they are opposite, as for a multiplier at -1."""
    together = np.exp(1j * first) + np.exp(1j * second)
    return np.where(np.abs(together) > 0.5, np.angle(together), first)


def enclose_boundary(margin: Callable[[Array, Array], Array], length: Array) -> SignedEnds:
    """Offsets from the middles between which the margin changes sign, towards the side that the middle's own sign says.

    Parameters: margin: (indices, offsets) -> margins; length (V,): of the pieces. Where no change is met, both ends have one sign.
    """
    here = margin(np.arange(len(length)), np.zeros(len(length)))
    outer, there, searching = np.zeros(len(length)), here.copy(), here != 0
    for k in range(TRIES):
        which = np.flatnonzero(searching)
        if not len(which):
            break
        outer[which] = -np.sign(here[which]) * min(FIRST * WIDER**k, FARTHEST) * length[which]
        there[which] = margin(which, outer[which])
        searching[which] = np.sign(there[which]) == np.sign(here[which])
    return SignedEnds(np.zeros(len(length)), outer, here, there)


def refine_pieces(
    vertices: Vertices, pairs: Array, function: SpectraFunction, tol: float, step: float
) -> tuple[Vertices, Array, Array]:
    """Halve the pieces between pairs (P, 2) of vertices until each cubic lies within tol / 2 of the boundary at its middle and its quarter.

    Returns: all vertices; for each the one that follows it, -1 where none does, and how far the boundary lay off; inf: it was not met.
    """
    links: list[tuple[Array, Array]] = []
    for _ in range(DEEPEST):
        if not len(pairs):
            break
        first, second = vertices.at(pairs[:, 0]), vertices.at(pairs[:, 1])
        found, off, slope = find_middles(first, second, function, tol / 8)
        length = np.linalg.norm(second.points - first.points, axis=1)
        short = length <= np.maximum(tol, BLURRED * np.maximum(first.errors, second.errors))
        near = np.flatnonzero((off <= tol / 2) & ~short)
        off[near] = np.maximum(
            off[near], measure_quarters(first.at(near), second.at(near), found.at(near), slope[near], function)
        )
        done = (off <= tol / 2) | short | ~np.isfinite(off)
        links.append((pairs[done], np.where(short, np.minimum(off, length), off)[done]))
        new = found.at(~done)
        directions = find_directions(new.points, new.angles, new.undamped, function, step)
        fresh = np.arange(len(vertices.points), len(vertices.points) + len(new.points))
        vertices = join_vertices(vertices, replace(new, directions=directions))
        halved = pairs[~done]
        pairs = np.concatenate([np.stack([halved[:, 0], fresh], axis=1), np.stack([fresh, halved[:, 1]], axis=1)])
    follower, distance = np.full(len(vertices.points), -1), np.zeros(len(vertices.points))
    for some, off in links:
        follower[some[:, 0]], distance[some[:, 0]] = some[:, 1], off
    return vertices, follower, distance


def join_vertices(some: Vertices, more: Vertices) -> Vertices:
    """Both sets, one behind the other."""
    return Vertices(*(np.concatenate([getattr(some, name), getattr(more, name)]) for name in Vertices.__annotations__))
