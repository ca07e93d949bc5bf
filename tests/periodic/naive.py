"""What is usually written, and by how much it misses."""

from functools import reduce

import numpy as np

from flexlin.periodic import place_edges
from tests.periodic.truths import apart

STEPS = 2000
"""Runge-Kutta steps a period of the naive code."""


def naive_exponents(system, steps=STEPS):
    """What is usually written: Runge-Kutta of order 4, the monodromy matrix multiplied out, its eigenvalues, their logs."""
    grid = place_edges(system.period, (), steps)
    h = np.diff(grid)[:, None, None]
    start, middle, end = (system.A(t) for t in (grid[:-1], grid[:-1] + h[:, 0, 0] / 2, grid[1:]))
    eye = np.eye(start.shape[-1])
    with np.errstate(all="ignore"):
        k1 = start
        k2 = middle @ (eye + h / 2 * k1)
        k3 = middle @ (eye + h / 2 * k2)
        k4 = end @ (eye + h * k3)
        factors = eye + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        monodromy = reduce(lambda before, step: step @ before, factors)
        if not np.isfinite(monodromy).all():
            return np.full(len(eye), np.inf)
        return np.log(np.linalg.eigvals(monodromy).astype(complex)) / system.period


def worst_miss(exponents, known, period):
    """The largest distance of a known exponent to the nearest one found, imaginary parts modulo 2 pi / T."""
    if not np.isfinite(exponents).all():
        return np.inf
    return float(apart(known, exponents, period).min(axis=1).max())
