"""Smooth functions of a period held by their values at equidistant nodes: derivative, low-pass filter and values in between."""

from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.precision import ROOT

KEPT = 1 / 3
"""The part of the nodes' harmonics that the filter keeps; the others hold the rounding that differentiation amplifies."""


def apply(operator: Array, values: Array) -> Array:
    """Let a real matrix (M, N) act on the first axis of real or complex values (N, ...)."""
    flat = np.ascontiguousarray(values).reshape(len(values), -1)
    done = (operator @ flat.view(float)).view(complex) if np.iscomplexobj(flat) else operator @ flat
    return done.reshape(len(operator), *values.shape[1:])


def harmonics(count: int) -> Array:
    """The harmonic numbers of NumPy's discrete Fourier transform of `count` values."""
    return np.fft.fftfreq(count, 1 / count)


@lru_cache(maxsize=64)
def multiplier(count: int, kept: float, power: int, shift: float) -> Array:
    """The matrix that multiplies harmonic k <= kept * count by (i k)^power exp(2 pi i k shift / count).

    The middle harmonic of an even count has no derivative and no shift of its own, so it is left out.
    Source: Trefethen, Spectral Methods in MATLAB (2000), chapter 3.
    """
    k = harmonics(count)
    inside = np.abs(k) <= min(kept * count, (count - 1) // 2)
    factor = inside * (1j * k) ** power * np.exp(2j * np.pi * k * shift / count)
    return np.fft.ifft(factor[:, None] * np.fft.fft(np.eye(count), axis=0), axis=0).real


def smooth(values: Array) -> Array:
    """Leave out the harmonics beyond KEPT times the number of nodes."""
    return apply(multiplier(len(values), KEPT, 0, 0.0), values)


def circle_derivative(values: Array, period: float, shift: float = 0.0) -> Array:
    """The derivative at nodes that are moved by `shift` spacings."""
    return 2 * np.pi / period * apply(multiplier(len(values), 0.5, 1, shift), values)


def shifted(values: Array, shift: float) -> Array:
    """The values at nodes that are moved by `shift` spacings."""
    return apply(multiplier(len(values), 0.5, 0, shift), values)


def interleaved(nodes: Array, between: Array) -> Array:
    """Values at nodes and half-way between them as one series of twice the density."""
    return np.stack([nodes, between], axis=1).reshape(2 * len(nodes), *nodes.shape[1:])


def interpolated(values: Array, period: float, t: Array) -> Array:
    """The trigonometric interpolant of nodes k T / N at the times t (M,), without the middle harmonic of an even count."""
    parts = np.ascontiguousarray(values).view(float)
    return FourierSeries.through(parts, period)(np.asarray(t, float)).view(values.dtype)


def tail(values: Array) -> float:
    """The largest harmonic of the upper half against the largest of all, entry by entry where that is not rounding."""
    spectrum = np.abs(np.fft.rfft(values, axis=0)).reshape(len(values) // 2 + 1, -1)
    whole = spectrum.max(axis=0)
    moving = spectrum[1:].max(axis=0) > ROOT * whole
    return float((spectrum[len(spectrum) // 2 :].max(axis=0)[moving] / whole[moving]).max()) if moving.any() else 0.0


def aliasing(values: Array) -> Array:
    """What harmonics beyond the nodes may add to a mean or a value in between: four times the largest of the top quarter.

    It covers harmonics that fall off like 1 / k^2, as after a corner.
    """
    spectrum = np.abs(np.fft.fft(values, axis=0)) / len(values)
    return 4 * spectrum[np.abs(harmonics(len(values))) > 3 / 8 * len(values)].max(axis=0)
