"""Transition matrices of a group of modes over parts of a period."""

from dataclasses import dataclass

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.periodic.fourier import fourier_waves

FINE, COARSE, FINER, METHOD = 3, 2, 0.25, 2.0
"""Parts of a segment that each Magnus series reaches over: the finer ones give the exponents, and the coarser ones the error. FINER of the
difference counts, METHOD times: of order 6 it would be 1 in (3 / 2)^6 - 1, a tenth."""
HIDDEN = 0.1
"""Harmonics are left out while they add up to less than this part of what is not known anyway."""

FACTOR = declare(
    "int factor_magnus(int n, int highest, const double *series, int segments, int parts, double period, double *F)",
    lambda n, highest, series, segments, *_: ((highest + 1, 2, n, n), (segments, n, n)),
)


@dataclass(frozen=True, eq=False)
class GroupSeries:
    """The real generator of a group as sums of cosines and sines (H + 1, 2, m, m), and what is not known of its entries (m, m)."""

    period: float
    coefficients: Array
    unknown: Array

    def sample(self, t: Array) -> Array:
        """The generator at the times t (N,): (N, m, m)."""
        a, b = (self.coefficients[:, k].reshape(len(self.coefficients), -1) for k in (0, 1))
        waves = fourier_waves(t / self.period, len(a) - 1)
        return (a[0] + waves.real @ a[1:] + waves.imag @ b[1:]).reshape(len(t), *self.unknown.shape)

    def factor(self, segments: int, parts: int) -> Array:
        """Transition matrices (segments, m, m) over equal segments, each by Magnus series of order 6 on so many parts.

        Raises: MemoryError.
        """
        m = len(self.unknown)
        F = np.empty((segments, m, m))
        if not FACTOR(m, len(self.coefficients) - 1, self.coefficients, segments, parts, self.period, F):
            raise MemoryError("the transition matrices of a group")
        return F


def fit_group(values: Array, period: float, unknown: Array) -> GroupSeries:
    """The Fourier series of a real generator (N, m, m) at the nodes k T / N, without the highest harmonics that are but rounding."""
    count = len(values)
    spectrum = np.fft.rfft(values, axis=0) / count
    spectrum[1 : (count + 1) // 2] *= 2
    beyond = np.cumsum(np.abs(spectrum[::-1]), axis=0)[::-1]
    hidden = (beyond[1:] <= HIDDEN * unknown).all(axis=(1, 2))
    kept = 1 + int(np.argmax(hidden)) if hidden.any() else len(spectrum)
    left_out = beyond[kept] if kept < len(spectrum) else 0.0
    coefficients = np.stack([spectrum.real, -spectrum.imag], axis=1)[:kept]
    return GroupSeries(period, np.ascontiguousarray(coefficients), unknown + left_out)
