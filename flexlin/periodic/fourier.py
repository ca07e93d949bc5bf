"""Periodic functions known at equally spaced times: trigonometric interpolation and differentiation."""

from dataclasses import dataclass
from functools import cached_property
from math import prod

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """The trigonometric polynomial through values (N, ...) at t_j = j T / N, N odd; call it with times (M,) to get (M, ...)."""

    values: Array
    period: float

    @cached_property
    def _coefficients(self) -> Array:
        """Real and imaginary parts of the coefficients of exp(2 pi i k t / T), k = 0 ... (N - 1) / 2, in rows of one matrix."""
        waves = np.fft.rfft(self.values.reshape(len(self.values), prod(self.values.shape[1:])), axis=0) / len(
            self.values
        )
        waves[1:] *= 2
        return np.concatenate([waves.real, waves.imag])

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """The function, or its derivative by time of the given order, at one time (...) or at times (M,): (M, ...)."""
        return at_times(lambda times: self._evaluate(times, derivative), t)

    def _evaluate(self, t: Array, derivative: int) -> Array:
        rates = 2j * np.pi / self.period * np.arange(len(self.values) // 2 + 1)
        waves = np.exp(t[:, None] * rates) * rates**derivative
        flat = np.concatenate([waves.real, -waves.imag], axis=1) @ self._coefficients
        return flat.reshape(len(t), *self.values.shape[1:])

    @property
    def tail(self) -> float:
        """The size of the two highest harmonics against the largest value: what the series would miss with fewer points."""
        highest = np.abs(self._coefficients.reshape(2, len(self.values) // 2 + 1, -1)[:, -2:])
        return float(highest.max() / max(np.abs(self.values).max(), np.finfo(float).tiny))


def differentiation(points: int, period: float) -> Array:
    """Return the matrix that takes values at N equally spaced times to the derivatives there, N odd.

    D_jk = (pi / T) (-1)^(j - k) / sin(pi (j - k) / N), 0 on the diagonal.
    Source: Trefethen, Spectral Methods in MATLAB (2000), ch. 3.
    """
    gaps = np.subtract.outer(np.arange(points), np.arange(points))
    off = gaps != 0
    D = np.zeros((points, points))
    D[off] = np.pi / period * (-1.0) ** gaps[off] / np.sin(np.pi * gaps[off] / points)
    return D
