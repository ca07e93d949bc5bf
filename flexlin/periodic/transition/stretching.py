"""What rounding costs the transition matrix of a segment over which A(t) is far from normal."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import ResolvedMatrix

NORMAL = 6.0
"""h |A| up to which a segment loses no more than roundings of its own size: the fastest mode of a normal A is given about as much."""
STEEP = 4
"""The power of h |A| with which the losses set in."""
LOSS = 0.005
"""Roundings of a stretched segment for each unit of its condition number: as many as nine of ten random segments have at the most."""


def count_roundings(resolved: ResolvedMatrix | ResolvedCompanion, grid: Array, factors: Array, scale: Array) -> Array:
    """How many roundings of its size each transition matrix carries, (K,): 1, and more where its stages cancel.

    A nilpotent part of A much larger than its eigenvalues makes stages far larger than what they add up to. Backward stability allows
    a condition number's worth of roundings there; where h |A| is small none of them cancel.

    Parameters: grid (K + 1,); factors (K, n, n) and scale (n,): balanced, as `balance_factors` gives them.
    Source: Higham, Accuracy and Stability of Numerical Algorithms (2002), ch. 7.
    """
    h = np.diff(grid)
    A = np.abs(resolved(grid[:-1] + h / 2) * (scale / scale[:, None]))
    stretch = h * np.sqrt(A.sum(axis=1).max(axis=1) * A.sum(axis=2).max(axis=1))
    counts, far = np.ones(len(h)), stretch > NORMAL
    if far.any():
        condition = np.nan_to_num(np.linalg.cond(factors[far], 1), nan=np.inf)
        counts[far] = np.maximum(1.0, np.minimum((stretch[far] / NORMAL) ** STEEP, LOSS * condition))
    return counts
