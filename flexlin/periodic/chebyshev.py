"""Functions by Chebyshev series on panels: interpolation on interior nodes, evaluation, differentiation."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times


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
    """Return the coefficients of the interpolants of values (P, K, E) at the nodes of P panels; constants without rounding."""
    start = values[:, :1]
    coefficients = chebyshev_transform(values.shape[1]) @ (values - start)
    coefficients[:, :1] += start
    return coefficients


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
