"""Functions of time by interpolation: Fourier series of a period, Chebyshev series on panels; and how a period is divided."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times, whole

CACHED_BYTES = 2**18
"""Bytes that are made at a time, of waves or of a coefficient's samples: with what these need on the way they stay in the processor's
cache."""
NODES, TAIL = 32, 4
"""Nodes of a panel, and how many of its last coefficients must have vanished."""
FINER_BOUNDS = (1.3, 4.0)
"""Bounds on how much finer the next resolution is: one that rounds independently, and one that is not far too fine."""
NAMED_PARTS = 200
"""With `complete`, what is narrower than T / NAMED_PARTS is named."""


def golden(i: Array) -> Array:
    """The golden sequence: no few of its numbers in (0, 1) lie close together."""
    return np.mod(i * (np.sqrt(5) - 1) / 2, 1.0)


def place_edges(period: float, breaks: Sequence[float] | Array, segments: int, least: int = 1) -> Array:
    """Divide [0, T] into about `segments` intervals of equal length, none of which holds a break inside.

    Every piece between neighbouring breaks gets ceil(segments * length / T) segments, and at least `least`.

    Parameters: period in s; breaks: times in [0, T); segments: the wished number.
    Returns: increasing times (K + 1,) from 0 to T, K >= segments.
    Raises: ArgumentError unless segments is a whole number from 1 on.
    """
    corners = np.unique([0.0, *breaks, period])
    grid = divided(corners, period / whole("segments", segments), least)
    return np.unique(grid)  # breaks one rounding apart leave no room for edges between them


def edges_of_short(edges: Array, longest: float) -> Array:
    """Return the edges of the panels that are shorter than `longest`: no step may pass over what a function does in one."""
    short = np.flatnonzero(np.diff(edges) < longest)
    return edges[np.union1d(short, short + 1)]


def divide_segments(grid: Array, parts: int) -> Array:
    """The grid with each segment divided into equal parts."""
    return divide_evenly(grid, np.full(len(grid) - 1, parts))


def divided(edges: Array, longest: float, least: int = 1) -> Array:
    """Divide intervals evenly, each into so many at the least, until none is longer."""
    return divide_evenly(edges, np.maximum(least, np.ceil(np.diff(edges) / longest * (1 - 1e-12)).astype(int)))


def divide_evenly(edges: Array, counts: Array) -> Array:
    """Each interval between edges (K + 1,) divided into so many (K,)."""
    which = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(np.repeat(edges[:-1], counts) + np.repeat(np.diff(edges) / counts, counts) * which, edges[-1])


def fourier_nodes(count: int, period: float) -> Array:
    """Return the times j T / N, j = 0 ... N - 1."""
    return period * np.arange(count) / count


def real_fourier_coefficients(values: Array) -> Array:
    """Return the real coefficients of the trigonometric interpolant of values (N, ...) at N equally spaced times.

        f(t) = c_0 + sum_k  c_k cos(2 pi k t / T) + c_(H + k) sin(2 pi k t / T),   k = 1 ... H = floor((N - 1) / 2)

    For even N the cosine of order N / 2 is left out. Constants are reproduced without rounding.
    Returns: (2 H + 1, ...), the mean first, then the cosines, then the sines.
    """
    count = len(values)
    start = values[:1]
    waves = np.fft.rfft(values - start, axis=0)[: (count - 1) // 2 + 1]
    waves *= 2 / count
    return np.concatenate([start + waves[:1].real / 2, waves[1:].real, -waves[1:].imag])


def fourier_waves(phase: Array, harmonics: int) -> Array:
    """Return exp(2 pi i k phase) for k = 1 ... H by repeated doubling of the order, (N, H); phase = t / T."""
    waves = np.empty((len(phase), harmonics), dtype=complex)
    if harmonics:
        waves[:, 0] = np.exp(2j * np.pi * (phase - np.floor(phase)))
    have = 1
    while have < harmonics:
        more = min(have, harmonics - have)
        np.multiply(waves[:, :more], waves[:, have - 1 : have], out=waves[:, have : have + more])
        have += more
    return waves


def fourier_basis(phase: Array, harmonics: int) -> Array:
    """Return 1, cos(2 pi k phase), sin(2 pi k phase), k = 1 ... H, as the columns of (N, 2 H + 1)."""
    waves = fourier_waves(phase, harmonics)
    basis = np.empty((len(phase), 2 * harmonics + 1))
    basis[:, 0] = 1.0
    basis[:, 1 : harmonics + 1] = waves.real
    basis[:, harmonics + 1 :] = waves.imag
    return basis


def harmonics(count: int) -> Array:
    """The harmonic numbers of NumPy's discrete Fourier transform of `count` values."""
    return np.fft.fftfreq(count, 1 / count)


def weigh_harmonics(values: Array, weight: Array) -> Array:
    """Values (N, ...) with each harmonic multiplied by a weight, (N,) or (N, ...), those of k and -k conjugate where values are real."""
    weight = weight.reshape(weight.shape + (1,) * (values.ndim - weight.ndim))
    if np.iscomplexobj(values):
        return np.fft.ifft(weight * np.fft.fft(values, axis=0), axis=0)
    waves = np.fft.rfft(values, axis=0)
    return np.fft.irfft(weight[: len(waves)] * waves, len(values), axis=0)


def turn_harmonics(count: int, shift: float) -> Array:
    """What the harmonics (N,) are multiplied by where the nodes are moved by `shift` spacings.

    The middle harmonic of an even count has no derivative and no shift of its own, so it is left out.
    Source: Trefethen, Spectral Methods in MATLAB (2000), chapter 3.
    """
    k = harmonics(count)
    return (np.abs(k) < count / 2) * np.exp(2j * np.pi * k * shift / count)


def circle_derivative(values: Array, period: float, shift: float = 0.0) -> Array:
    """The derivative at nodes that are moved by `shift` spacings."""
    rate = 2j * np.pi / period * harmonics(len(values))
    return weigh_harmonics(values, rate * turn_harmonics(len(values), shift))


def shifted(values: Array, shift: float) -> Array:
    """The values at nodes that are moved by `shift` spacings."""
    return weigh_harmonics(values, turn_harmonics(len(values), shift))


@dataclass(frozen=True, eq=False)
class FourierSeries:
    """A function with period T: coefficients (2 H + 1, ...) in the order of `real_fourier_coefficients`; call it with one time or (N,)."""

    coefficients: Array
    period: float

    @classmethod
    def through(cls, values: Array, period: float) -> "FourierSeries":
        """The interpolant of values (N, ...) at `fourier_nodes(N, T)`."""
        return cls(real_fourier_coefficients(values), period)

    @property
    def degree(self) -> int:
        """The highest harmonic H."""
        return len(self.coefficients) // 2

    @property
    def waves(self) -> tuple[Array, Array]:
        """The coefficients of the cosines and of the sines, (H, ...) each."""
        return self.coefficients[1 : self.degree + 1], self.coefficients[self.degree + 1 :]

    @property
    def constant(self) -> bool:
        """Whether nothing but the mean is there."""
        return not self.degree

    @property
    def rate(self) -> float:
        """How much faster than itself the function may change, in 1/s: as its fastest wave."""
        return 2 * np.pi / self.period * max(self.degree, 1)

    @property
    def edges(self) -> Array:
        """One panel: the period."""
        return np.array([0.0, self.period])

    def __call__(self, t: ArrayLike, derivative: int = 0) -> Array:
        """The function, or its derivative by time of the given order, at one time (...) or at times (N,): (N, ...)."""
        series = self
        for _ in range(derivative):
            series = series.derivative()
        return at_times(series._evaluate, t)

    def _evaluate(self, t: Array) -> Array:
        flat = self.coefficients.reshape(len(self.coefficients), -1)
        values, some = np.empty((len(t), flat.shape[1])), max(1, CACHED_BYTES // (8 * len(flat)))
        for part in (slice(i, i + some) for i in range(0, len(t), some)):
            np.matmul(fourier_basis(t[part] / self.period, self.degree)[:, 1:], flat[1:], out=values[part])
        values += flat[0]  # last: many small waves added to a large mean would round once each
        return values.reshape(len(values), *self.coefficients.shape[1:])

    def derivative(self) -> "FourierSeries":
        """The derivative by time."""
        H = self.degree
        rate = (2 * np.pi / self.period * np.arange(1, H + 1)).reshape(-1, *[1] * (self.coefficients.ndim - 1))
        mean, cosine, sine = np.split(self.coefficients, [1, H + 1])
        return FourierSeries(np.concatenate([np.zeros_like(mean), rate * sine, -rate * cosine]), self.period)

    def mean(self) -> Array:
        """The integral over the period, divided by the period."""
        return self.coefficients[0].copy()


@lru_cache(maxsize=32)
def chebyshev_nodes(count: int) -> Array:
    """Return the zeros of T_K in (-1, 1), ascending: no node on an edge, where a coefficient may be one-sided."""
    u = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
    u.setflags(write=False)
    return u


@lru_cache(maxsize=32)
def chebyshev_transform(count: int) -> Array:
    """Return the matrix (K, K) from values at `chebyshev_nodes` to coefficients: c_k = (2 - [k = 0]) / K sum_j f_j T_k(u_j)."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    matrix = 2 / count * np.cos(np.multiply.outer(np.arange(count), np.pi - angle))
    matrix[0] /= 2
    matrix.setflags(write=False)
    return matrix


def chebyshev_coefficients(values: Array) -> Array:
    """Return the coefficients of the interpolants of values (P, K, ...) at the nodes of P panels; constants without rounding."""
    flat = values.reshape(*values.shape[:2], -1)
    coefficients = chebyshev_transform(values.shape[1]) @ (flat - flat[:, :1])
    coefficients[:, :1] += flat[:, :1]
    return coefficients.reshape(values.shape)


def panel_times(begin: Array, end: Array, count: int) -> Array:
    """Return the Chebyshev nodes of panels (P,), strictly inside them: (P, K)."""
    middle, half = (begin + end) / 2, (end - begin) / 2
    t = middle[:, None] + half[:, None] * chebyshev_nodes(count)
    return np.clip(t, np.nextafter(begin, np.inf)[:, None], np.nextafter(end, -np.inf)[:, None])


@dataclass(frozen=True, eq=False)
class ChebyshevPanels:
    """A matrix function with period T = edges[-1]: one Chebyshev series for each panel, coefficients (P, K, rows, columns)."""

    edges: Array
    coefficients: Array

    @property
    def period(self) -> float:
        """The last edge, in s."""
        return float(self.edges[-1])

    @property
    def degree(self) -> int:
        """The degree of the panels' polynomials."""
        return self.coefficients.shape[1] - 1

    @property
    def constant(self) -> bool:
        """Whether all panels hold the same constant."""
        return not self.degree and bool(np.all(self.coefficients == self.coefficients[0]))

    @property
    def rate(self) -> float:
        """How much faster than itself the function may change, in 1/s: as a polynomial on the narrowest panel, by Markov's inequality."""
        return 2 * max(self.degree, 1) ** 2 / float(np.diff(self.edges).min())

    def __call__(self, t: ArrayLike, left: bool = False) -> Array:
        """Evaluate at times t (N,), any real: (N, rows, columns), or at one time; at an edge the panel behind it counts, or before it."""
        return at_times(lambda times: self._evaluate(times, left), t)

    def _evaluate(self, t: Array, left: bool) -> Array:
        period, shape = self.period, self.coefficients.shape
        t = np.mod(np.asarray(t, dtype=float), period)
        if left:
            t = np.where(t == 0, period, t)
        panel = np.clip(np.searchsorted(self.edges, t, side="left" if left else "right") - 1, 0, shape[0] - 1)
        order = np.argsort(panel, kind="stable")
        t, panel = t[order], panel[order]
        begin, end = self.edges[panel], self.edges[panel + 1]
        basis = chebyshev.chebvander(((t - begin) - (end - t)) / (end - begin), shape[1] - 1)
        flat = self.coefficients.reshape(*shape[:2], -1)
        values = np.empty((len(t), flat.shape[2]))
        bounds = np.searchsorted(panel, np.arange(shape[0] + 1))
        for p in np.flatnonzero(np.diff(bounds)):
            rows = slice(bounds[p], bounds[p + 1])
            values[order[rows]] = basis[rows] @ flat[p]
        return values.reshape(len(t), *shape[2:])

    def derivative(self) -> "ChebyshevPanels":
        """The derivative by time inside the panels; a jump leaves no impulse."""
        slopes = chebyshev.chebder(self.coefficients, axis=1)
        width = np.diff(self.edges).reshape(-1, *[1] * (self.coefficients.ndim - 1))
        return ChebyshevPanels(self.edges, slopes * (2 / width))

    def mean(self) -> Array:
        """The integral over the period, divided by the period: int_-1^1 T_k = 2 / (1 - k^2) for even k."""
        even = np.arange(0, self.coefficients.shape[1], 2)
        share = np.diff(self.edges) / self.period
        return np.einsum("p,k,pkij->ij", share, 1 / (1 - even**2.0), self.coefficients[:, ::2])
