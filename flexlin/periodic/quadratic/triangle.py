"""A symmetric periodic matrix by the Fourier series of its lower triangle: complex amplitudes (n (n + 1) / 2, H + 1)."""

from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries

FEWEST = 96
"""Values of a period that are looked at, at the least."""
FLOOR = 2e-16
"""Harmonics below this part of the largest entry are rounding."""


def fold_triangle(values: Array) -> Array:
    """Return the amplitudes of values (E, N): harmonics up to N / 3, whose residual shows at N times, and none that are rounding."""
    count = values.shape[1]
    amplitudes = np.fft.rfft(values)[:, : count // 3]
    size = np.abs(amplitudes).max(axis=0)
    keep = int(np.count_nonzero(np.sqrt((size[::-1] ** 2).cumsum())[::-1] > FLOOR * size.max()))
    amplitudes = amplitudes[:, : max(keep, 1)] / count
    amplitudes[:, 1:] *= 2
    return np.asarray(amplitudes)


def fold_few(values: Array, tol: float) -> tuple[Array, int]:
    """Return the amplitudes of values (E, N) by as few of them as show all harmonics above tol: every so many."""
    every = 2 ** max(0, int(np.log2(values.shape[1] / FEWEST)))
    while values.shape[1] % (4 * every):
        every //= 2
    while True:
        few = values[:, ::every]
        amplitudes = fold_triangle(few)
        last = np.abs(amplitudes[:, few.shape[1] // 4 :]).max(initial=0.0)
        if every == 1 or last <= tol * np.abs(amplitudes[:, 0]).max():
            return amplitudes, every
        every //= 2


def evaluate_triangle(amplitudes: Array, count: int) -> Array:
    """Return a function at N equally spaced nodes, at least twice as many as it has amplitudes: (E, N)."""
    spectrum = np.zeros((len(amplitudes), count // 2 + 1), complex)
    spectrum[:, : amplitudes.shape[1]] = amplitudes * (0.5 * count)
    spectrum[:, 0] *= 2
    return np.fft.irfft(spectrum, count)


def evaluate_between(amplitudes: Array, period: float, count: int) -> tuple[Array, Array]:
    """Return a function and its derivative half-way between N equally spaced nodes, more than it has amplitudes: (E, N) each."""
    entries, kept = amplitudes.shape
    shift, rate = shift_half(count, kept)
    spectrum = np.zeros((2, entries, count // 2 + 1), complex)
    np.multiply(amplitudes, shift, out=spectrum[0, :, :kept])
    np.multiply(spectrum[0, :, :kept], rate / period, out=spectrum[1, :, :kept])
    values, slopes = np.fft.irfft(spectrum, count)
    return values, slopes


@lru_cache(maxsize=16)
def shift_half(count: int, kept: int) -> tuple[Array, Array]:
    """Return what takes amplitudes to those of NumPy's inverse transform half a step later, and to those of the derivative by t / T."""
    waves = np.arange(kept)
    shift = np.where(waves, 0.5, 1.0) * count * np.exp(1j * np.pi / count * waves)
    return shift, 2j * np.pi * waves


def unfold_triangle(amplitudes: Array, period: float) -> FourierSeries:
    """Return the whole matrix as a real Fourier series."""
    parts = np.concatenate([amplitudes.real, -amplitudes.imag[:, 1:]], axis=1)
    return FourierSeries(parts.T[:, triangle_places(len(amplitudes))], period)


@lru_cache(maxsize=32)
def triangle_places(entries: int) -> Array:
    """Return where each entry (n, n) of a symmetric matrix stands among those of its lower triangle, row by row."""
    n = int(np.sqrt(2 * entries))
    found, (rows, columns) = np.zeros((n, n), int), np.tril_indices(n)
    found[rows, columns] = found[columns, rows] = np.arange(entries)
    return found
