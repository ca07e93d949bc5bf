"""The exponential of a batch of matrices."""

import math
from functools import cache

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.product.balancing import balance_factors

THETA = 5.371920351148152
"""Below this 1-norm the Pade approximant of order 13 is exact to working precision (Higham 2005, table 2.3)."""


@cache
def pade() -> Array:
    """The numerator of the diagonal Pade approximant of order 13: (26 - k)! / ((13 - k)! k!), k = 0 ... 13."""
    f = math.factorial
    return np.array([f(26 - k) // (f(13 - k) * f(k)) for k in range(14)], dtype=float)


def exponentiate(X: Array) -> Array:
    """exp(X) for X (K, n, n), by one diagonal balancing, scaling and squaring with the Pade approximant of order 13.

    Raises: ToleranceNotReached when a result leaves the range of floating-point numbers.
    Source: Higham, The scaling and squaring method revisited, SIAM J. Matrix Anal. Appl. 26 (2005).
    """
    X, scale = balance_factors(X)
    norm = float(np.abs(X).sum(axis=-2).max())
    squarings = max(0, int(np.ceil(np.log2(norm / THETA)))) if norm > 0 else 0
    X = X / 2.0**squarings
    X2 = X @ X
    X4 = X2 @ X2
    X6 = X2 @ X4
    b, eye = pade(), np.eye(X.shape[-1])
    U = X @ (X6 @ (b[13] * X6 + b[11] * X4 + b[9] * X2) + b[7] * X6 + b[5] * X4 + b[3] * X2 + b[1] * eye)
    V = X6 @ (b[12] * X6 + b[10] * X4 + b[8] * X2) + b[6] * X6 + b[4] * X4 + b[2] * X2 + b[0] * eye
    E = np.linalg.solve(V - U, V + U)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(squarings):
            E = E @ E
    if not np.isfinite(E).all():
        raise ToleranceNotReached("a segment's exponential overflows", got=f"norm {norm:.2g}", todo="use more segments")
    return E * (scale[:, None] / scale)
