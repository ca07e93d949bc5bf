"""GMRES for a linear operator on arrays."""

from collections.abc import Callable

import numpy as np

from flexlin.checks import Array


def solve_by_gmres(operator: Callable[[Array], Array], right: Array, tol: float, most: int) -> tuple[Array, float]:
    """Find x with |operator(x) - right| <= tol |right| in a Krylov space of at most `most` dimensions.

    Each new vector is made orthogonal twice, so the small least-squares problem tells the true residual.
    Returns: x, shaped as `right`, and the relative residual that it leaves.
    Source: Saad, Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856.
    """
    size = float(np.linalg.norm(right))
    if size == 0.0 or not np.isfinite(size):
        return np.zeros_like(right), 0.0 if size == 0.0 else np.inf
    basis, projected = np.empty((most + 1, right.size)), np.zeros((most + 1, most))
    basis[0] = right.ravel() / size
    for k in range(1, most + 1):
        vector, known = operator(basis[k - 1].reshape(right.shape)).ravel(), basis[:k]
        for _ in range(2):
            shares = known @ vector
            vector = vector - shares @ known
            projected[:k, k - 1] += shares
        length = float(np.linalg.norm(vector))
        projected[k, k - 1] = length
        small = projected[: k + 1, :k]
        target = size * np.eye(k + 1)[0]
        y = np.linalg.lstsq(small, target, rcond=None)[0]
        left = float(np.linalg.norm(small @ y - target)) / size
        if left <= tol or length <= 1e-14 * np.abs(small).max():
            break
        basis[k] = vector / length
    return (y @ basis[:k]).reshape(right.shape), left
