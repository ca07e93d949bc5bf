"""GMRES for a linear operator on arrays."""

import math
from collections.abc import Callable

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import LAPACK


def solve_by_gmres(operator: Callable[[Array], Array], right: Array, tol: float, most: int) -> tuple[Array, float]:
    """Find x with |operator(x) - right| <= tol |right| in a Krylov space of at most `most` dimensions.

    Each new vector is made orthogonal twice, so the small least-squares problem, solved by rotations,
    gives the true residual.
    Returns: x, shaped as `right`, and the relative residual that it leaves.
    Source: Saad, Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856.
    """
    size = float(np.linalg.norm(right))
    if size == 0.0 or not np.isfinite(size):
        return np.zeros_like(right), 0.0 if size == 0.0 else np.inf
    basis, triangle, target = np.empty((most + 1, right.size)), np.zeros((most, most)), np.zeros(most + 1)
    basis[0], target[0] = right.ravel() / size, size
    turns: list[tuple[float, float]] = []
    for k in range(most):
        vector, known = operator(basis[k].reshape(right.shape)).ravel(), basis[: k + 1]
        shares = known @ vector
        vector = vector - shares @ known
        again = known @ vector
        vector -= again @ known
        length = float(np.linalg.norm(vector))
        column = (shares + again).tolist()
        for i, (c, s) in enumerate(turns):
            column[i], column[i + 1] = c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]
        corner = math.hypot(column[k], length) or 1.0
        c, s = column[k] / corner, length / corner
        turns.append((c, s))
        triangle[: k + 1, k] = [*column[:k], corner]
        target[k], target[k + 1] = c * target[k], -s * target[k]
        left = abs(float(target[k + 1])) / size
        if not left > tol:
            break
        basis[k + 1] = vector / length
    y = LAPACK.dtrtrs(triangle[: k + 1, : k + 1], target[: k + 1])[0]
    return (y @ basis[: k + 1]).reshape(right.shape), left
