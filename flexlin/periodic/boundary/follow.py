"""The boundary between two of its points: cubic pieces, halved until the boundary's own middle agrees with them."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import Effort, SpectraFunction, measure_margins
from flexlin.periodic.precision import FOURTH, TINY
from flexlin.periodic.roots import SignedEnds, solve_uncertain

STEP = FOURTH
"""Of the ranges: the step of the differences that give the margin's gradient, whose only use is the direction of the boundary.

Exact derivatives cost 170 to 400 times as much as four values of the compiled kernel (13 times with 12 states), and turn it by 1e-5 rad
at the most.
"""
EXACT = 8.0
"""Points of the boundary are placed to this part of the wanted error; also how many times farther from a piece's middle each next look
for the boundary goes."""
NEAR = 0.25
"""Of the wanted distance, how far a cubic may lie off: twice that, the chords and a vertex stay below it together."""


@dataclass(frozen=True)
class Vertices:
    """Points (V, 2) of the boundary in the unit square: direction (V, 2) with the unstable side on the left, error (V,), and the margin
    by which they were found: angle of the growing multiplier and whether it is undamped; an unstable point nearby (V, 2)."""

    points: Array
    directions: Array
    errors: Array
    angles: Array
    undamped: Array
    inside: Array

    def at(self, which: Array) -> "Vertices":
        """Some of the vertices."""
        return Vertices(*(one[which] for one in self.columns()))

    def beside(self, more: "Vertices") -> "Vertices":
        """These vertices and more behind them."""
        return Vertices(*(np.concatenate(pair) for pair in zip(self.columns(), more.columns(), strict=True)))

    def columns(self) -> list[Array]:
        return [getattr(self, name) for name in Vertices.__annotations__]


def find_directions(
    points: Array, angles: Array, undamped: Array, function: SpectraFunction, step: float = STEP
) -> Array:
    """Unit tangents (V, 2) of the boundary, unstable side on the left, by central differences of the margin."""
    moves = step * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    places = np.clip(points[None] + moves[:, None], 0.0, 1.0)
    spectra = function(places.reshape(-1, 2))
    margin = measure_margins(spectra, np.tile(undamped, 4), np.tile(angles, 4))[0].reshape(4, -1)
    across = (margin[0] - margin[1]) / (places[0, :, 0] - places[1, :, 0])
    up = (margin[2] - margin[3]) / (places[2, :, 1] - places[3, :, 1])
    return np.stack([up, -across], axis=1) / np.maximum(np.hypot(across, up), TINY)[:, None]


def place_cubic(first: Vertices, second: Vertices, share: Array) -> Array:
    """Points (V, S, 2) at shares (S,) of the cubics through two vertices with their directions."""
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
    length = np.linalg.norm(second.points - first.points, axis=1)
    middle = place_cubic(first, second, np.array([0.5]))[:, 0]
    along = 6 * (second.points - first.points) - length[:, None] * (first.directions + second.directions)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    normal /= np.maximum(np.linalg.norm(along, axis=1), TINY)[:, None]
    undamped, angles = first.undamped & second.undamped, mean_angles(first.angles, second.angles)

    def margin(which: Array, offsets: Array) -> tuple[Array, Array]:
        places = np.clip(middle[which] + offsets[:, None] * normal[which], 0.0, 1.0)
        return measure_margins(function(places), undamped[which], angles[which])

    every = np.arange(len(middle))
    here, outer = margin(every, 0.0 * length)[0], np.zeros(len(middle))
    there, offset, which = here.copy(), STEP, np.flatnonzero(here)
    while len(which):  # the margin's sign says on which side the boundary lies
        outer[which] = -np.sign(here[which]) * min(offset, 1.0) * length[which]
        there[which] = margin(which, outer[which])[0]
        which = which[(np.sign(there) == np.sign(here))[which] & (offset < 1)]
        offset *= EXACT
    met = np.flatnonzero(here * there <= 0)
    start = SignedEnds(np.zeros(len(met)), outer[met], here[met], there[met])
    ends, left = solve_uncertain(lambda k, x: margin(met[k], x), start, accuracy)
    off, error, slope = np.full(len(middle), np.inf), np.zeros(len(middle)), np.full(len(middle), TINY)
    reach = np.maximum(start.width, TINY)
    slope[met] = np.maximum(np.abs(there - here)[met] / reach, TINY)
    error[met] = np.minimum(left / slope[met], reach) + ends.width / 2
    off[met], middle[met] = np.abs(ends.best), middle[met] + ends.best[:, None] * normal[met]
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


def mean_angles(first: Array, second: Array) -> Array:
    """Half-way between angles on the circle; the first where they are opposite, as for a multiplier at -1."""
    together = np.exp(1j * first) + np.exp(1j * second)
    return np.where(np.abs(together) > 0.5, np.angle(together), first)


def refine_pieces(
    vertices: Vertices, pairs: Array, function: SpectraFunction, tol: float, step: float, effort: Effort
) -> tuple[Vertices, Array, Array]:
    """Halve the pieces between pairs (P, 2) of vertices until each cubic lies within NEAR tol of the boundary at middle and quarter, or the
    effort ends.

    Returns: all vertices; for each the one that follows it, -1 where none does, and how far the boundary lay off; inf: it was not met.
    """
    follower, distance = np.full(len(vertices.points), -1), np.zeros(len(vertices.points))
    while len(pairs):
        first, second = vertices.at(pairs[:, 0]), vertices.at(pairs[:, 1])
        found, off, slope = find_middles(first, second, function, tol / EXACT)
        length = np.linalg.norm(second.points - first.points, axis=1)
        short = length <= np.maximum(tol, EXACT * np.maximum(first.errors, second.errors))
        near = np.flatnonzero((off <= NEAR * tol) & ~short)
        quarters = measure_quarters(first.at(near), second.at(near), found.at(near), slope[near], function)
        off[near] = np.maximum(off[near], quarters)
        done = (off <= NEAR * tol) | short | ~np.isfinite(off)
        if not effort.affords(0):
            effort.unfinished |= not done.all()
            off = np.where(done, off, EXACT * off)  # between an end and the middle of such a piece nobody looked
            done = np.full(len(pairs), True)
        follower[pairs[done, 0]] = pairs[done, 1]
        distance[pairs[done, 0]] = np.where(short, np.minimum(off, length), off)[done]
        new, halved = found.at(~done), pairs[~done]
        directions = find_directions(new.points, new.angles, new.undamped, function, step)
        fresh = np.arange(len(vertices.points), len(vertices.points) + len(new.points))
        vertices = vertices.beside(replace(new, directions=directions))
        follower, distance = np.append(follower, 0 * fresh - 1), np.append(distance, 0.0 * fresh)
        pairs = np.concatenate([np.stack([halved[:, 0], fresh], axis=1), np.stack([fresh, halved[:, 1]], axis=1)])
    return vertices, follower, distance
