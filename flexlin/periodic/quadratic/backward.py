"""Compiled sweeps of the Riccati equation backwards over a period, by Adams' methods: the calls of sweeps.c."""

import ctypes
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import find_kept_library

ROW = 4
"""Rows are filled up to a multiple of this."""


@lru_cache(maxsize=1)
def find_sweeps() -> ctypes.CDLL | None:
    """The library of sweeps.c; none where there is no compiler."""
    library = find_kept_library(Path(__file__).with_name("sweeps.c"))
    if library is not None:
        whole, long, real, place = ctypes.c_int, ctypes.c_long, ctypes.c_double, ctypes.c_void_p
        coefficients: list[Any] = [place, long] * 3
        library.close_by_newton.argtypes = [whole, whole, long, whole, real, place, *coefficients, place, real]
        library.find_share.argtypes = [whole, whole, long, *coefficients, place, place, real, ctypes.POINTER(real)]
        library.find_share.restype = real
    return library


@lru_cache(maxsize=4)
def adams_weights(order: int) -> Array:
    """Return the weights of Adams' explicit and implicit method of an order p, (2 p,), the newest rate first.

    Integrals over [0, 1] of Lagrange's polynomials through the nodes 0, -1, ... and 1, 0, -1, ...
    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), III.1.
    """
    weights = []
    for first in (0, 1):
        nodes = [first - j for j in range(order)]
        for node in nodes:
            polynomial = [Fraction(1)]
            for other in (one for one in nodes if one != node):
                higher, lower = [Fraction(0), *polynomial], [*polynomial, Fraction(0)]
                polynomial = [(a - other * b) / (node - other) for a, b in zip(higher, lower, strict=True)]
            weights.append(float(sum(c / (i + 1) for i, c in enumerate(polynomial))))
    return np.array(weights)


@dataclass(frozen=True, eq=False)
class RiccatiSamples:
    """A, -S / 2, Q / 2 at N times, (N, n, w) or (1, n, w) where constant, in rows filled up with zeros."""

    A: Array
    S: Array
    Q: Array
    count: int

    @classmethod
    def of(cls, coefficients: tuple[Array, Array, Array]) -> "RiccatiSamples":
        """Fill the rows of A, S, Q (N, n, n)."""
        A, S, Q = coefficients
        return cls(fill_rows(A), fill_rows(S, -0.5), fill_rows(Q, 0.5), len(A))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Times, states and numbers in a row."""
        return self.count, self.A.shape[1], self.A.shape[2]

    def every(self, step: int, first: int = 0) -> "RiccatiSamples":
        """The samples at every step-th time."""
        A, S, Q = (one[first::step] if len(one) > 1 else one for one in (self.A, self.S, self.Q))
        return RiccatiSamples(A, S, Q, self.count // step)

    def places(self) -> tuple[int, ...]:
        """Where A, S and Q stand, and the numbers from one sample to the next."""
        found: list[int] = []
        for one in (self.A, self.S, self.Q):
            found += [one.ctypes.data, one.strides[0] // one.itemsize if len(one) > 1 else 0]
        return tuple(found)


def fill_rows(values: Array, factor: float = 1.0) -> Array:
    """Return a multiple of matrices (N, n, n) in rows filled up with zeros (N, n, w); the one matrix of a constant once."""
    values = values[:1] if values.strides[0] == 0 else values
    count, n, _ = values.shape
    filled = np.zeros((count, n, -(-n // ROW) * ROW))
    np.multiply(values, factor, out=filled[:, :, :n])
    return filled


def close_by_newton(
    library: ctypes.CDLL, samples: RiccatiSamples, period: float, order: int, near: float, X: Array
) -> Array | None:
    """Sweep X back over the period by Adams' predictor and corrector until it closes: X at the nodes (N, n, w), N even.

    A sweep maps X(T) to X(0); with Phi its loop's transition matrix over the period, Newton's method for X(0) = X(T) adds

        E = Phi' E Phi + X(0) - X(T)

    It ends after an E below `near` of X. A loop that does not forget is swept on: the cost of a longer horizon has a better one.
    Parameters: X (p, n, w): at the first nodes of the next period, p the order.
    Source: Hewer, IEEE Trans. Automat. Control 16 (1971) 382; for E: Smith, SIAM J. Appl. Math. 16 (1968) 198.
    """
    count, n, width = samples.shape
    found = np.empty(samples.shape)
    found[:order] = X[:order]
    method = (order, period / count, adams_weights(order).ctypes.data)
    sweeps = library.close_by_newton(n, width, count, *method, *samples.places(), found.ctypes.data, near)
    return found if sweeps else None


def find_share(
    library: ctypes.CDLL, samples: RiccatiSamples, X: Array, slopes: Array, unit: float
) -> tuple[float, float]:
    """Return the least r with -r C <= F <= r C at all times, C = Q + X S X, and the largest entry of F.

    F: the residual X' + A' X + X A - X S X + Q of X and its slopes X' (N, n, w), and what rounding may make of it: `unit` times the
    sum of the sizes of its terms. r is infinite where C is not positive.
    """
    count, n, width = samples.shape
    largest = ctypes.c_double()
    places = (X.ctypes.data, slopes.ctypes.data)
    share = library.find_share(n, width, count, *samples.places(), *places, unit, ctypes.byref(largest))
    return share, largest.value
