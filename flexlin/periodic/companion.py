"""From second order to first: the companion form of M y'' + D y' + K y = F u, with the mass matrix solved for."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import SingularMassMatrix


def build_companion(M: Array, D: Array, K: Array, t: Array) -> Array:
    """Return A = [[0, I], [-M^-1 K, -M^-1 D]] for x = [y; y'], (N, 2n, 2n), from M, D, K (N, n, n) at the times t (N,).

    Raises: SingularMassMatrix, naming the time.
    """
    n = M.shape[-1]
    solved = -solve_mass(M, np.concatenate([K, D], axis=-1), t)
    return stack_companion(solved[..., :n], solved[..., n:])


def build_input(M: Array, F: Array, t: Array) -> Array:
    """Return B = [0; M^-1 F] for x = [y; y'], (N, 2n, m), from M (N, n, n) and F (N, n, m) at the times t (N,).

    Raises: SingularMassMatrix, naming the time.
    """
    lower = solve_mass(M, F, t)
    return np.concatenate([np.zeros_like(lower), lower], axis=-2)


def stack_companion(X: Array, Y: Array) -> Array:
    """Return [[0, I], [X, Y]] for blocks (..., n, n): the state matrix of y'' = X y + Y y'."""
    n = X.shape[-1]
    A = np.zeros((*X.shape[:-2], 2 * n, 2 * n))
    A[..., :n, n:] = np.eye(n)
    A[..., n:, :n], A[..., n:, n:] = X, Y
    return A


def solve_mass(M: Array, right: Array, t: Array) -> Array:
    """Solve M z = right at each time, naming the time at which M is singular."""
    try:
        return np.linalg.solve(M, right)
    except np.linalg.LinAlgError:
        worst = int(np.argmin([np.linalg.svd(m, compute_uv=False)[-1] for m in M]))
        raise SingularMassMatrix(
            f"the mass matrix is singular at t = {t[worst]:.6g} s",
            todo="give every coordinate inertia, or remove the coordinate",
        ) from None
