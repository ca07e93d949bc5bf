"""Bases for Ritz's method: not modes, but complete and cheap."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from flexlin.checks import Array


@dataclass(frozen=True)
class Polynomials:
    """The basis phi_k'' = sqrt(2k + 1) P_k(2 xi - 1), phi_k(0) = phi_k'(0) = 0: orthonormal in bending on a uniform beam."""

    n: int
    breaks: tuple[float, ...] = ()

    @property
    def beta(self) -> Array:
        """Not modes: no roots."""
        return np.full(self.n, np.nan)

    @property
    def order(self) -> int:
        """Exact for products of two."""
        return self.n + 4

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi or its derivative with respect to xi: (N,) -> (n, N)."""
        return legendre_series(self.n, derivative - 2, xi)

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return X', the section's rotation, or its derivative: (N,) -> (n, N)."""
        return self.values(xi, derivative + 1)


@dataclass(frozen=True)
class HermiteElements:
    """The cubic Hermite basis on equal elements, clamped at xi = 0: deflection and slope (times the element's length) at each node."""

    elements: int

    @property
    def n(self) -> int:
        """Two functions a node."""
        return 2 * self.elements

    @property
    def beta(self) -> Array:
        """Not modes: no roots."""
        return np.full(self.n, np.nan)

    @property
    def breaks(self) -> tuple[float, ...]:
        """The nodes between elements."""
        return tuple((np.arange(1, self.elements) / self.elements).tolist())

    @property
    def order(self) -> int:
        """Exact for products of two cubics."""
        return 4

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi or its derivative with respect to xi: (N,) -> (n, N)."""
        place = np.asarray(xi) * self.elements
        element = np.clip(place.astype(int), 0, self.elements - 1)
        cubics = np.array([[1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]], dtype=float)
        local = np.polynomial.polynomial.polyval(
            place - element, np.polynomial.polynomial.polyder(cubics, derivative, axis=1).T
        )
        whole = np.zeros((self.n + 2, len(place)))
        whole[2 * element + np.arange(4)[:, None], np.arange(len(place))] = local
        return whole[2:] * float(self.elements) ** derivative

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return X', the section's rotation, or its derivative: (N,) -> (n, N)."""
        return self.values(xi, derivative + 1)


@dataclass(frozen=True)
class ShearedPolynomials:
    """The polynomials phi, that bend and turn the sections, and Y_k' = sqrt(2k + 1) P_k(2 xi - 1), Y_k(0) = 0, that shear alone."""

    degree: int
    breaks: tuple[float, ...] = ()

    @property
    def n(self) -> int:
        """As many of one kind as of the other."""
        return 2 * self.degree

    @property
    def beta(self) -> Array:
        """Not modes: no roots."""
        return np.full(self.n, np.nan)

    @property
    def order(self) -> int:
        """Exact for products of two."""
        return self.degree + 4

    def values(self, xi: Array, derivative: int = 0) -> Array:
        """Return the deflections or their derivative with respect to xi: (N,) -> (n, N)."""
        return np.concatenate([legendre_series(self.degree, derivative - below, xi) for below in (2, 1)])

    def rotation(self, xi: Array, derivative: int = 0) -> Array:
        """Return phi' above zeros, or its derivative: (N,) -> (n, N)."""
        bending = legendre_series(self.degree, derivative - 1, xi)
        return np.concatenate([bending, np.zeros_like(bending)])


def legendre_series(n: int, derivative: int, xi: Array) -> Array:
    """Return sqrt(2k + 1) P_k(2 xi - 1), k < n, differentiated (or, if negative, integrated from 0) in xi: (n, N)."""
    unit = np.diag(np.sqrt(2 * np.arange(n) + 1.0))
    if not n:
        return np.zeros((0, len(xi)))
    down, up = max(-derivative, 0), max(derivative, 0)
    series = legendre.legder(legendre.legint(unit, down, lbnd=-1, scl=0.5), up, scl=2.0)
    return legendre.legval(2 * np.asarray(xi) - 1, series)
