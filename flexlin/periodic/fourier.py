"""Periodic functions known at equally spaced times: trigonometric interpolation and differentiation."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flexlin.checks import Array


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """The trigonometric polynomial through values (N, r) at t_j = j T / N, N odd; call it with times (M,) to get (M, r)."""

    values: Array
    period: float

    @cached_property
    def _coefficients(self) -> Array:
        return np.fft.rfft(self.values, axis=0) / len(self.values)

    def __call__(self, t: Array, derivative: int = 0) -> Array:
        """The function, or its derivative by time of the given order."""
        rates = 2j * np.pi / self.period * np.arange(len(self._coefficients))
        waves = np.exp(np.asarray(t)[:, None] * rates) * rates**derivative
        waves[:, 1:] *= 2
        return (waves @ self._coefficients).real


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
