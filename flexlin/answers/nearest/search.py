"""The way to the nearest place where a loop loses its stability: rays first, then along the boundary."""

from itertools import pairwise, product

import numpy as np

from flexlin.answers.nearest.box import Box
from flexlin.checks import Array

CORNERS, SPREAD, LEVELS = 64, 32, 20
"""Directions to corners of the box, directions spread over its faces, and distances tried on each, the nearest first."""
FEW = 8
"""Distances tried along the growth rate's gradient and its parts alone, for a loop whose spectra take long."""
STARTS, STEPS, SETTLED = 2, 12, 1e-7
"""Rays from which the nearest place is sought, steps of each, and the relative shortening that ends them."""
WIDER = (1.05, 1.3, 2.0)
"""Multiples of a known crossing at which one on another ray is looked for."""


def list_directions(box: Box) -> Array:
    """Axes, corners and a spread over the faces (D, P), each with a largest entry of 1; along the growth rate's gradient where dear."""
    from scipy.stats import qmc  # as SciPy's optimisers, it takes longer to load than most reports to compute

    P = len(box.own)
    if box.family.slow:
        uphill = box.uphill()
        return np.unique(np.vstack([uphill, np.diag(uphill)]), axis=0)
    every = 2**P <= CORNERS
    signs = (
        list(product([-1.0, 1.0], repeat=P)) if every else np.random.default_rng(0).choice([-1.0, 1.0], (CORNERS, P))
    )
    inside = 2 * qmc.Sobol(P, seed=0).random(SPREAD) - 1
    faces = inside / np.abs(inside).max(axis=1, keepdims=True) if P > 1 else inside[:0]
    return np.unique(np.vstack([np.eye(P), -np.eye(P), signs, faces]), axis=0)


def scan(box: Box) -> list[tuple[Array, float]]:
    """The rays that are unstable at the nearest distance at which one is: direction and crossing."""
    directions = list_directions(box)
    count = FEW if box.family.slow else LEVELS
    levels = box.furthest * np.arange(count + 1) / count
    for before, level in pairwise(levels):
        unstable = directions[box.family.rough(box.values(level * directions)).logs.real.max(axis=1) > 0]
        rays = [d for d in unstable if box.growth(level * d) > 0 > box.growth(before * d)]
        if rays:
            found = [(d, cross(box, d, before, level)) for d in rays[: 4 * STARTS]]
            return sorted(found, key=lambda ray: ray[1])[:STARTS]
    return []


def follow(box: Box, direction: Array, scale: float) -> Array:
    """Follow the boundary of stability from r d to the smallest r: the least of r(d) for -1 <= d <= 1.

    growth(r d) = 0,   dr/dd_i = -r g_i / (g . d),   g: the growth rate's gradient at r d
    """
    from scipy.optimize import minimize

    places = [scale * direction]

    def shortest(d: Array) -> tuple[float, Array]:
        r = find_crossing(box, d, float(np.abs(places[-1]).max()))
        if not np.isfinite(r):
            return 4 * box.furthest, np.zeros(len(d))
        if r * np.abs(d).max() < np.abs(places[-1]).max():
            places.append(r * d)
        g = box.slope(r * d)
        return r, -r * g / float(g @ d)

    bounds = [(-1.0, 1.0)] * len(direction)
    options = {"maxiter": STEPS, "maxfun": 2 * STEPS, "ftol": SETTLED}
    minimize(shortest, direction, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return np.asarray(places[-1])


def find_crossing(box: Box, direction: Array, near: float) -> float:
    """The scale on a ray at which the growth rate is zero, sought about one that is known on another ray; infinite where there is none."""
    if box.growth(near * direction) > 0:
        return cross(box, direction, 0.0, near)
    for wider in WIDER:
        if box.growth(wider * near * direction) > 0:
            return cross(box, direction, near, wider * near)
    return float(np.inf)


def cross(box: Box, direction: Array, stable: float, unstable: float) -> float:
    """The scale on a ray at which the growth rate is zero, between a stable and an unstable one."""
    from scipy.optimize import brentq

    return float(brentq(lambda r: box.growth(r * direction), stable, unstable, xtol=1e-12, rtol=1e-12))
