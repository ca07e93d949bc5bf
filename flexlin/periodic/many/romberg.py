"""Floquet exponents of many second-order systems at once: Magnus' exponential on finer and finer segments, extrapolated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import LAPACK
from flexlin.periodic.companion import stack_companion
from flexlin.periodic.grid import divide_segments, place_edges
from flexlin.periodic.many.algebra import exponentiate_batch
from flexlin.periodic.many.extrapolation import MULTIPLES, extrapolate, find_gains, measure_spread
from flexlin.periodic.many.spectrum import find_product_logs, group_batch
from flexlin.periodic.transition.gauss import gauss, place_nodes

BLOCK = 2048
"""Matrices in one batched exponential: its temporaries then stay in the processor's cache."""
Coefficients = Callable[[Array], tuple[Array, Array]]
"""Phases (N,) -> X, Y (N, n, n, V) of y'' = X y + Y y', time in units of the period."""


@dataclass(frozen=True)
class BatchedExponents:
    """logs (2 n, V) of the multipliers, their estimated errors (2 n, V), and whether they were computed soundly (V,)."""

    logs: Array
    errors: Array
    sound: Array


def batched_exponents(
    coefficients: Coefficients,
    segments: int,
    breaks: Sequence[float] = (),
    accuracy: float = 1e-10,
    spread: float = np.inf,
    memory: int = 0,
) -> BatchedExponents:
    """Logs of the Floquet multipliers of y'' = X(phase) y + Y(phase) y' over one period, for V values at once.

        an exponential of order 4 on 2 K, 3 K, 4 K segments; logs extrapolated to order 8, with an error by the steps that lead there

    Assumes X, Y smooth between the breaks.

    Parameters: coefficients; segments K; breaks: phases in [0, 1);
    accuracy: of the exponentials and eigenvalues, well below the error that is wanted;
    spread: of the logs of all moduli but the smallest, where it is known beforehand (it spares work at the first resolution);
    memory: how many of the last coordinates are ignorable: their columns of X are zero, and the exponents are those of x = [y; y'] without
    them.
    Returns: BatchedExponents; where an error is too large, more segments or `floquet` may help.
    Source: Blanes, Casas, Oteo, Ros, Physics Reports 470 (2009), Eq. (253); Richardson's extrapolation of a symmetric method.
    """
    base = place_edges(1.0, breaks, segments)
    scale = balance_states(*coefficients(base[:-1]), memory)
    levels: list[Array] = []
    sound: Array | bool = True
    Q = None
    for multiple in MULTIPLES[:3]:
        factors, log_det = exponentiate_segments(coefficients, divide_segments(base, multiple), scale, accuracy, memory)
        logs, fine, Q = find_product_logs(group_batch(factors, spread, accuracy), log_det, accuracy, Q)
        spread = measure_spread(logs[:, fine])
        sound = sound & fine
        levels.append(logs)
    logs, errors = extrapolate(levels, find_gains(*MULTIPLES[:3]), accuracy, memory)
    return BatchedExponents(logs, errors, np.asarray(sound))


def balance_states(X: Array, Y: Array, memory: int = 0) -> Array:
    """One scaling (2 n,) of the states by powers of two that evens rows and columns of the mean of |A| = |[[0, I], [X, Y]]|.

    Velocities are scaled as their coordinates, but for one factor: so the upper half of A stays a multiple of [0, I]. The ignorable
    coordinates, the last `memory`, follow their velocities.
    """
    A = stack_companion(np.abs(X).mean(axis=(0, 3)), np.abs(Y).mean(axis=(0, 3)))
    places, rates = np.log2(LAPACK.dgebal(A, scale=1, permute=0)[3]).reshape(2, -1)
    own = len(places) - memory
    factor = np.round(np.mean(rates[:own] - places[:own]))
    places[own:] = rates[own:] - factor
    places = np.round((places + rates - factor) / 2)
    return np.asarray(2.0 ** np.concatenate([places, places + factor]))


def exponentiate_segments(
    coefficients: Coefficients, grid: Array, scale: Array, accuracy: float, memory: int = 0
) -> tuple[Array, Array]:
    """Factors (K, s, s, V) of the segments of the grid, of the scaled states, and the log determinant (V,) of their product.

    s = 2 n less `memory`, the ignorable coordinates, which stand behind the others and are left out.

        F_k = (I + N_(k+1))^-1 (I + N_k) exp(h (A1 + A2) / 2),   N = sqrt(3) h (A2 - A1) / 12,   N_K = N_0

    The product is similar to that of (I + N) exp(h (A1 + A2) / 2) (I + N)^-1, which is Magnus' exponential
    exp(h (A1 + A2) / 2 - sqrt(3) h^2 [A1, A2] / 12) up to h^5 and as symmetric in time; but [[0, I], [X, Y]] keeps its form.
    """
    X, Y = coefficients(place_nodes(grid, gauss(2).c).ravel())
    h, n = np.diff(grid)[:, None, None, None], X.shape[1]
    below = np.concatenate([X, Y], axis=2) * (scale / scale[n:, None])[..., None]
    below = np.delete(below, np.s_[n - memory : n], axis=2)
    means, changes = h / 2 * (below[::2] + below[1::2]), np.sqrt(3) / 12 * h * (below[1::2] - below[::2])
    factors = np.empty((len(h), below.shape[2], *below.shape[2:]))
    step = max(1, BLOCK // X.shape[-1])
    for k in range(0, len(h), step):
        factors[k : k + step] = exponentiate_means(means[k : k + step], h[k : k + step] * scale[n] / scale[0], accuracy)
    join_segments(factors, changes)
    trace = np.einsum("kiiv->kv", Y)
    return factors, np.repeat(np.diff(grid) / 2, 2) @ trace


def exponentiate_means(below: Array, above: Array, accuracy: float) -> Array:
    """exp [[0, above I, 0], [below]] for below (K, states - n, states, V), above (K, 1, 1, 1)."""
    K, rows, states, V = below.shape
    n = states - rows
    A = np.zeros((states, states, K, V))
    A[np.arange(n), n + np.arange(n)] = above[:, 0, 0]
    A[n:] = np.moveaxis(below, 0, 2)
    return np.moveaxis(exponentiate_batch(A.reshape(states, states, -1), accuracy).reshape(A.shape), 2, 0)


def join_segments(factors: Array, changes: Array) -> None:
    """E_k -> (I + N_(k+1))^-1 (I + N_k) E_k in place, N = [[0, 0], [changes]]: only the lower rows change."""
    rows, states = changes.shape[1:3]
    n = states - rows
    following = np.roll(changes, -1, axis=0)
    matrices = np.moveaxis(np.eye(rows)[..., None] + following[:, :, n:], -1, 1)
    Z = np.linalg.solve(matrices, np.moveaxis(changes - following, -1, 1))
    factors[:, n:] += np.einsum("kvij,kjlv->kilv", Z, factors)
