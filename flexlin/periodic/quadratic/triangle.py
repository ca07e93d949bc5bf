"""A symmetric periodic matrix by the real Fourier series of its lower triangle, row by row: (2 H + 1, n (n + 1) / 2)."""

from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries


def evaluate_triangle(series: Array, count: int) -> Array:
    """Return a series at N equally spaced nodes, at least twice as many as it has waves: (N, n (n + 1) / 2)."""
    H = len(series) // 2
    spectrum = np.zeros((count // 2 + 1, series.shape[1]), complex)
    spectrum[0] = count * series[0]
    spectrum[1 : H + 1] = 0.5 * count * (series[1 : H + 1] - 1j * series[H + 1 :])
    return np.fft.irfft(spectrum, count, axis=0)


def unfold_triangle(series: Array, period: float) -> FourierSeries:
    """Return the whole matrix as a Fourier series."""
    return FourierSeries(np.take(series, triangle_places(series.shape[1]), axis=1), period)


@lru_cache(maxsize=32)
def lower_triangle(n: int) -> tuple[Array, Array]:
    """Return the rows and columns of a lower triangle, row by row."""
    return np.tril_indices(n)


@lru_cache(maxsize=32)
def triangle_places(entries: int) -> Array:
    """Return where each entry (n, n) of a symmetric matrix stands among those of its lower triangle."""
    n = int(np.sqrt(2 * entries))
    found, (rows, columns) = np.zeros((n, n), int), lower_triangle(n)
    found[rows, columns] = found[columns, rows] = np.arange(entries)
    return found
