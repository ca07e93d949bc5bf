"""A periodic cubic spline through values at equally spaced times."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flexlin.checks import Array


@dataclass(frozen=True, eq=False)
class PeriodicSpline:
    """The cubic spline of period T through values (N, ...) at the times k T / N, twice continuously differentiable.

    Slopes m_k: m_(k-1) + 4 m_k + m_(k+1) = 3 N (y_(k+1) - y_(k-1)) / T, solved by Fourier's transform; between them Hermite's cubic.
    Source: de Boor, A Practical Guide to Splines (1978), chapter IV.
    """

    values: Array
    slopes: Array
    period: float
    complete: ClassVar[bool] = True

    @classmethod
    def through(cls, values: Array, period: float) -> "PeriodicSpline":
        """The spline through the values."""
        count = len(values)
        rise = 3 * (np.roll(values, -1, axis=0) - np.roll(values, 1, axis=0)) * count / period
        diagonal = 4 + 2 * np.cos(2 * np.pi * np.arange(count // 2 + 1) / count)
        flat = np.fft.rfft(rise.reshape(count, -1), axis=0) / diagonal[:, None]
        return cls(values, np.fft.irfft(flat, count, axis=0).reshape(values.shape), period)

    def __call__(self, t: Array) -> Array:
        """The values at times (N,): (N, ...)."""
        count = len(self.values)
        place = np.mod(t, self.period) * (count / self.period)
        k = np.minimum(place.astype(int), count - 1)
        u = (place - k).reshape(-1, *[1] * (self.values.ndim - 1))
        after, width = (k + 1) % count, self.period / count
        turned = width * (u * (1 - u) ** 2 * self.slopes[k] - u * u * (1 - u) * self.slopes[after])
        return (1 - u) ** 2 * (1 + 2 * u) * self.values[k] + u * u * (3 - 2 * u) * self.values[after] + turned
