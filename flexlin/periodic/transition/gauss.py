"""Gauss-Legendre and Radau collocation: their tableaus, and the transition matrices of all segments in one batched solve."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.coefficients import MatrixFunction, check_finite

DEFAULT_STAGES = 8
"""Where nobody asks for a number of them: of order 16."""
CHUNK_BYTES = 2**25
"""What is computed at once takes at most this many bytes (one segment or one mode at the least)."""


@dataclass(frozen=True, eq=False)
class Tableau:
    """The Butcher tableau of a collocation method on [0, 1]: order 2 s at the ends, s + 1 in between."""

    c: Array
    a: Array
    b: Array


@lru_cache(maxsize=64)
def gauss(stages: int) -> Tableau:
    """Return the s-stage Gauss-Legendre tableau, a_ij = int_0^c_i l_j, to working precision.

    The Lagrange polynomial is l_j = b_j sum_k (2 k + 1) P_k(x_j) P_k on the Gauss nodes, and
    int_0^c P_k = (P_(k+1) - P_(k-1)) / (2 (2 k + 1)), so no Vandermonde matrix is inverted.
    Source: Hairer, Wanner, Solving ODEs II, IV.5.
    """
    x, w = leggauss(stages)
    b = w / 2
    a = integrate_legendre(x, stages) @ ((2 * np.arange(stages) + 1)[:, None] * legvander(x, stages - 1).T) * b
    return Tableau((1 + x) / 2, a, b)


def integrate_legendre(x: Array, count: int) -> Array:
    """int_-1^x P_m(s) ds / 2 for m < count: (N, count)."""
    P, m = legvander(x, count), np.arange(1, count)
    return np.column_stack([(1 + x) / 2, (P[:, 2:] - P[:, :-2]) / (2 * (2 * m + 1))])


def place_nodes(edges: Array, c: Array) -> Array:
    """Return the times (..., K, s) of the stages of the segments between edges (..., K + 1); one at an end stands before a jump there."""
    t = edges[..., :-1, None] + np.diff(edges)[..., None] * c
    return np.minimum(t, np.nextafter(edges[..., 1:, None], -np.inf))


def sample_at(A: MatrixFunction, t: Array) -> Array:
    """Sample a coefficient at times of any shape: (..., n, m)."""
    return fold_samples(A(t.ravel()), t)


def fold_samples(values: Array, t: Array) -> Array:
    """Give samples (N, n, m) at the times t.ravel() the shape of t: (..., n, m).

    Raises: ArgumentError, naming the time, when a sample is not finite.
    """
    if not np.isfinite(values).all():
        check_finite("a coefficient", values, t.ravel())
    return values.reshape(*t.shape, *values.shape[1:])


def collocate(A: Array, h: Array, rule: Tableau) -> Array:
    """Transition matrices (..., n, n) from stage samples A (..., s, n, n) and lengths h (...)."""
    s, n = A.shape[-3:-1]
    right = np.broadcast_to(np.eye(n), (*A.shape[:-3], s, n, n))
    hA = A * h[..., None, None, None]
    Y = solve_stages(hA, rule, right)
    return Y[..., -1, :, :] if rule.c[-1] == 1.0 else np.eye(n) + weigh_stages(hA, rule, Y)


def weigh_stages(hA: Array, rule: Tableau, Y: Array) -> Array:
    """h sum_j b_j A_j Y_j for stage values Y (..., s, n, r)."""
    s, n, r = Y.shape[-3:]
    row = np.swapaxes(hA * rule.b[:, None, None], -3, -2).reshape(*hA.shape[:-3], n, s * n)
    return row @ Y.reshape(*Y.shape[:-3], s * n, r)


def solve_stages(hA: Array, rule: Tableau, right: Array) -> Array:
    """Solve Y_i - sum_j a_ij h A_j Y_j = right_i for the stages: hA (..., s, n, n), right (..., s, n, r).

    Raises: NumericalError.
    """
    s, n, r = right.shape[-3:]
    G = np.empty((*hA.shape[:-3], s, n, s, n), hA.dtype)
    np.multiply(-rule.a[:, None, :, None], np.swapaxes(hA, -3, -2)[..., None, :, :, :], out=G)
    G = G.reshape(*hA.shape[:-3], s * n, s * n)
    diagonal = np.arange(s * n)
    G[..., diagonal, diagonal] += 1
    try:
        return np.linalg.solve(G, right.reshape(*right.shape[:-3], s * n, r)).reshape(right.shape)
    except np.linalg.LinAlgError:
        raise NumericalError(
            "the stages of a segment are not determined: it is too long for A(t)",
            todo="ask for more segments, or leave method and segments to the solver",
        ) from None


@lru_cache(maxsize=16)
def radau(stages: int) -> Tableau:
    """Return the s-stage Radau IIA tableau; c_s = 1, so the last stage is the step's result.

    L-stable: a mode with h Re lambda -> -infinity is damped to nothing, where Gauss collocation would keep it undamped. The error is
    O(h^(2 stages - 1)), less on stiff modes.
    Source: Hairer, Wanner, Solving ODEs II, IV.5; the inner nodes are the zeros of the Jacobi polynomial P^(1,0)_(s-1), eigenvalues
    of its recurrence (Golub, Welsch 1969).
    """
    k = np.arange(1, stages)
    diagonal, beside = -1 / ((2 * k - 1) * (2 * k + 1)), np.sqrt(k * (k + 1.0)) / (2 * k + 1)
    x = np.append(np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside[:-1], -1)), 1.0)
    a = np.linalg.solve(legvander(x, stages - 1).T, integrate_legendre(x, stages).T).T
    return Tableau((1 + x) / 2, a, a[-1])
