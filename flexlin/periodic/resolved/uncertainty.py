"""What the coefficients are not known by, as couplings of the modes: rounding of their entries and the error of their series."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import ResolvedMatrix

ROUNDINGS, LASTING = 4.0, 1.0
"""Roundings that an entry of A, M, D or K carries at one time, and those of them that are alike at all times."""
EPS = float(np.finfo(float).eps)


def couple_uncertainty(
    resolved: ResolvedMatrix | ResolvedCompanion,
    t: Array,
    left: Array,
    right: Array,
    error: Array | None = None,
    roundings: float = ROUNDINGS,
) -> Array:
    """Bounds on the entries of left dA right at times t (N,), (N, n, n) in 1/s, for left and right vectors (N, n, n).

        first order:   |L| |dA| |R|
        second order:  |V| (|dM| |z| + |dD| |R_v| + |dK| |R_y|),   V = L_v M^-1,   z = the accelerations that belong to R

    error: of the series about each time, as `mean_error` gives it; that of the whole period where it is left out; roundings: those that an
    entry carries.
    The second form keeps what M^-1 does to a rounding of M: the product with the left vectors is taken before the moduli.
    """
    if isinstance(resolved, ResolvedCompanion):
        error = resolved.blocks.error if error is None else error
        return couple_second_order(resolved, t, left, right, error, roundings)
    A = np.abs(resolved(t))
    error = resolved.error if error is None else error
    return np.asarray(np.abs(left) @ ((roundings * EPS * A + error) @ np.abs(right)))


def couple_second_order(
    resolved: ResolvedCompanion, t: Array, left: Array, right: Array, error: Array, roundings: float
) -> Array:
    """The second form, for left vectors as rows and right ones as columns."""
    M, D, K = resolved.sample(t)
    n = M.shape[-1]
    known = [roundings * EPS * np.abs(X) + e for X, e in zip((M, D, K), resolved.split(error), strict=True)]
    V = np.swapaxes(np.linalg.solve(np.swapaxes(M, -1, -2), np.swapaxes(left[..., n:], -1, -2)), -1, -2)
    position, rate = right[..., :n, :], right[..., n:, :]
    z = np.linalg.solve(M, K @ position + D @ rate)
    moved = known[0] @ np.abs(z) + known[1] @ np.abs(rate) + known[2] @ np.abs(position)
    return np.asarray(np.abs(V) @ moved)
