"""Floquet exponents of many second-order systems at once: Magnus' exponential on doubled segments, extrapolated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgebal

from flexlin.checks import Array
from flexlin.periodic.circle import measure_distances, wrap_log
from flexlin.periodic.companion import stack_companion
from flexlin.periodic.grid import place_edges
from flexlin.periodic.many.algebra import exponentiate_batch, multiply
from flexlin.periodic.many.spectrum import find_product_logs, group_batch
from flexlin.periodic.transition.gauss import gauss, place_nodes

ORDER = 4
LEVELS = 3
BLOCK = 2048
"""Matrices in one batched exponential: its temporaries then stay in the processor's cache."""
SAFETY, NOISE = 32.0, 40.0
"""Factor on the last differences of Romberg's table, and roundings in the log of a multiplier."""

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

        Magnus of order 4 on K, 2 K, 4 K segments; logs extrapolated by Romberg's scheme to order 8, whose last step gives the error

    Assumes X, Y smooth between the breaks.

    Parameters: coefficients; segments K; breaks: phases in [0, 1);
    accuracy: of the exponentials and eigenvalues, well below the error that is wanted;
    spread: of the logs of all moduli but the smallest, where it is known beforehand (it spares work at the first resolution).
    Returns: BatchedExponents; where an error is too large, more segments or `floquet` may help.
    Source: Blanes, Casas, Oteo, Ros, Physics Reports 470 (2009), Eq. (253); Richardson's extrapolation of a symmetric method.
    """
    grid = place_edges(1.0, breaks, segments)
    scale = balance_states(*coefficients(grid[:-1]))
    table: list[Array] = []
    sound: Array | bool = True
    Q = None
    for _ in range(LEVELS):
        factors, log_det = exponentiate_segments(coefficients, grid, scale, accuracy)
        logs, fine, Q = find_product_logs(group_batch(factors, spread, accuracy), log_det, accuracy, Q)
        spread = measure_spread(logs[:, fine])
        sound = sound & fine
        below = table[-1] if table else logs
        table = extrapolate(table, logs)
        grid = halve_segments(grid)
    return BatchedExponents(wrap_log(table[-1]), estimate_romberg_error(table, below, accuracy), np.asarray(sound))


def estimate_romberg_error(table: list[Array], below: Array, accuracy: float) -> Array:
    """Error of the last entry, by the steps that lead to it: from the lower order, and from the coarser resolution.

    Where Romberg's scheme converges as it should, the second is 4^3 times the first; where it does not, it counts more.
    """
    last = table[-1]
    across, down = np.abs(wrap_log(last - table[-2])), np.abs(wrap_log(last - take_nearest(last, below)))
    noise = NOISE * np.finfo(float).eps
    return SAFETY * (across + down / 2 ** (ORDER + 2)) + (noise + accuracy) * np.abs(last) + noise


def measure_spread(logs: Array) -> float:
    """The widest spread of the logs of the moduli, the smallest of each value left out; infinite where nothing is known."""
    sizes = np.sort(logs.real, axis=0)[min(1, len(logs) - 1) :]
    return float(np.ptp(sizes, axis=0).max()) if sizes.size else np.inf


def halve_segments(grid: Array) -> Array:
    """The grid with the middle of each segment added."""
    return np.sort(np.concatenate([grid, (grid[1:] + grid[:-1]) / 2]))


def balance_states(X: Array, Y: Array) -> Array:
    """One scaling (2 n,) of the states by powers of two that evens rows and columns of the mean of |A| = |[[0, I], [X, Y]]|."""
    A = stack_companion(np.abs(X).mean(axis=(0, 3)), np.abs(Y).mean(axis=(0, 3)))
    return np.asarray(dgebal(A, scale=1, permute=0)[3])


def extrapolate(row: list[Array], logs: Array) -> list[Array]:
    """The next row of Romberg's table; its columns have the orders 4, 6, 8 ...

    The finer logs are paired with the coarser ones, nearest first, and imaginary parts are taken modulo 2 pi.
    """
    new = [logs]
    for i, coarse in enumerate(row):
        gain = 2.0 ** (ORDER + 2 * i) - 1
        new.append(new[i] + wrap_log(new[i] - take_nearest(new[i], coarse)) / gain)
    return new


def take_nearest(fine: Array, coarse: Array) -> Array:
    """The coarse log that lies nearest to each fine one."""
    return np.take_along_axis(coarse, measure_distances(fine, coarse).argmin(axis=1), axis=0)


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
