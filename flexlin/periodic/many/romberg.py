"""Floquet exponents of many second-order systems at once: Magnus' exponential on finer and finer segments, extrapolated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgebal

from flexlin.checks import Array
from flexlin.periodic.companion import stack_companion
from flexlin.periodic.grid import place_edges
from flexlin.periodic.many.algebra import exponentiate_batch, multiply
from flexlin.periodic.many.extrapolation import MULTIPLES, extrapolate, find_gains
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
) -> BatchedExponents:
    """Logs of the Floquet multipliers of y'' = X(phase) y + Y(phase) y' over one period, for V values at once.

        Magnus of order 4 on 2 K, 3 K, 4 K segments; logs extrapolated to order 8, with an error by the steps that lead there

    Assumes X, Y smooth between the breaks.

    Parameters: coefficients; segments K; breaks: phases in [0, 1);
    accuracy: of the exponentials and eigenvalues, well below the error that is wanted;
    spread: of the logs of all moduli but the smallest, where it is known beforehand (it spares work at the first resolution).
    Returns: BatchedExponents; where an error is too large, more segments or `floquet` may help.
    Source: Blanes, Casas, Oteo, Ros, Physics Reports 470 (2009), Eq. (253); Richardson's extrapolation of a symmetric method.
    """
    base = place_edges(1.0, breaks, segments)
    scale = balance_states(*coefficients(base[:-1]))
    levels: list[Array] = []
    sound: Array | bool = True
    Q = None
    for multiple in MULTIPLES[:3]:
        factors, log_det = exponentiate_segments(coefficients, divide_segments(base, multiple), scale, accuracy)
        logs, fine, Q = find_product_logs(group_batch(factors, spread, accuracy), log_det, accuracy, Q)
        spread = measure_spread(logs[:, fine])
        sound = sound & fine
        levels.append(logs)
    logs, errors = extrapolate(levels, find_gains(*MULTIPLES[:3]), accuracy)
    return BatchedExponents(logs, errors, np.asarray(sound))


def measure_spread(logs: Array) -> float:
    """The widest spread of the logs of the moduli, the smallest of each value left out; infinite where nothing is known."""
    sizes = np.sort(logs.real, axis=0)[min(1, len(logs) - 1) :]
    return float(np.ptp(sizes, axis=0).max()) if sizes.size else np.inf


def divide_segments(grid: Array, parts: int) -> Array:
    """The grid with each segment divided into equal parts."""
    starts = grid[:-1, None] + np.diff(grid)[:, None] * (np.arange(parts) / parts)
    return np.append(starts, grid[-1])


def balance_states(X: Array, Y: Array) -> Array:
    """One scaling (2 n,) of the states by powers of two that evens rows and columns of the mean of |A| = |[[0, I], [X, Y]]|."""
    A = stack_companion(np.abs(X).mean(axis=(0, 3)), np.abs(Y).mean(axis=(0, 3)))
    return np.asarray(dgebal(A, scale=1, permute=0)[3])


def exponentiate_segments(
    coefficients: Coefficients, grid: Array, scale: Array, accuracy: float
) -> tuple[Array, Array]:
    """Transition matrices (K, 2 n, 2 n, V) over the segments of the grid, of the scaled states, and their log determinant (V,)."""
    X, Y = coefficients(place_nodes(grid, gauss(2).c).ravel())
    segments, n, values = len(grid) - 1, X.shape[1], X.shape[-1]
    h = np.repeat(np.diff(grid), values)
    factors = np.empty((segments, 2 * n, 2 * n, values))
    step = max(1, BLOCK // values)
    for k in range(0, segments, step):
        first, second = slice(2 * k, 2 * (k + step), 2), slice(2 * k + 1, 2 * (k + step), 2)
        omega = form_omega(
            flatten_segments(X[first]),
            flatten_segments(Y[first]),
            flatten_segments(X[second]),
            flatten_segments(Y[second]),
            h[k * values : (k + step) * values],
        )
        omega *= (scale / scale[:, None])[..., None]
        E = exponentiate_batch(omega, accuracy)
        factors[k : k + step] = np.moveaxis(E.reshape(2 * n, 2 * n, -1, values), 2, 0)
    trace = np.einsum("kiiv->kv", Y)
    return factors, np.repeat(np.diff(grid) / 2, 2) @ trace


def flatten_segments(A: Array) -> Array:
    """(K, n, n, V) -> (n, n, K V)."""
    return np.moveaxis(A, 0, 2).reshape(*A.shape[1:3], -1)


def form_omega(X1: Array, Y1: Array, X2: Array, Y2: Array, h: Array) -> Array:
    """Omega = h (A1 + A2) / 2 - sqrt(3) h^2 [A1, A2] / 12 for A = [[0, I], [X, Y]], with products of n x n blocks only.

    [A1, A2] = [[X2 - X1, Y2 - Y1], [Y1 X2 - Y2 X1, X1 - X2 + [Y1, Y2]]]
    """
    n, c = len(X1), np.sqrt(3) / 12 * h * h
    omega = np.empty((2 * n, 2 * n, X1.shape[-1]))
    dX = X2 - X1
    omega[:n, :n] = -c * dX
    omega[:n, n:] = c * (Y1 - Y2)
    omega[np.arange(n), n + np.arange(n)] += h
    omega[n:, :n] = h / 2 * (X1 + X2) - c * (multiply(Y1, X2) - multiply(Y2, X1))
    omega[n:, n:] = h / 2 * (Y1 + Y2) - c * (multiply(Y1, Y2) - multiply(Y2, Y1) - dX)
    return omega
