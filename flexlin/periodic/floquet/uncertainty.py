"""What A(t) is not known by: rounding of its entries, the error of its series, and what a mass matrix makes of rounding."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.system import PeriodicSystem

EPS = float(np.finfo(float).eps)
ROUNDINGS = 4.0
"""Roundings that an entry of A(t) carries."""
PLACES = np.array([0.0, 0.37, 0.71])
"""Where in the period the mass matrix is looked at."""


def bound_uncertainty(system: PeriodicSystem, grid: Array) -> Array:
    """Bounds on int |dA| dt over each segment of the grid, entry by entry, (K, n, n)."""
    h = np.diff(grid)[:, None, None]
    A = np.abs(system.resolved((grid[1:] + grid[:-1]) / 2))
    return h * (ROUNDINGS * EPS * A + bound_beyond_rounding(system, A))


def bound_beyond_rounding(system: PeriodicSystem, A: Array) -> Array:
    """Bounds on |dA| beside the rounding of the entries: the error of the series, and the rounding of M; for |A| (..., n, n)."""
    known = np.broadcast_to(system.resolved.error, A.shape).copy()
    if system.second_order is not None:
        half = system.n // 2
        known[..., half:, :] += EPS * bound_mass_rounding(system) @ A[..., half:, :]
    return known


def bound_mass_rounding(system: PeriodicSystem) -> Array:
    """|M^-1| |M|, (n, n): by how much M^-1 K answers a rounding of M, entry by entry, the largest over a few times.

    Source: Higham, Accuracy and Stability of Numerical Algorithms (2002), 7.2 (Bauer's and Skeel's condition numbers).
    """
    assert system.second_order is not None
    M = system.second_order.M(system.period * PLACES)
    return np.asarray((np.abs(np.linalg.inv(M)) @ np.abs(M)).max(axis=0))
