"""Compiled sweeps of the Riccati equation backwards over a period, by Adams' methods: the calls of sweeps.c."""

import ctypes
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.compiler import find_kept_library

ROW = 4
"""Rows are filled up to a multiple of this."""


@lru_cache(maxsize=1)
def find_sweeps() -> ctypes.CDLL | None:
    """The library of sweeps.c; none where there is no compiler."""
    library = find_kept_library(Path(__file__).with_name("sweeps.c"))
    if library is not None:
        whole, long, real, place = ctypes.c_int, ctypes.c_long, ctypes.c_double, ctypes.c_void_p
        coefficients = [place, long] * 3
        library.sweep.argtypes = [whole, whole, long, whole, real, place, *coefficients, place, place, place]
        library.find_share.argtypes = [whole, whole, long, *coefficients, place, place, real, ctypes.POINTER(real)]
        library.sweep.restype, library.find_share.restype = None, real
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
class Samples:
    """A, S, Q at N times, (N, n, w) or (1, n, w) where constant, in rows filled up with zeros."""

    A: Array
    S: Array
    Q: Array
    count: int

    @classmethod
    def of(cls, coefficients: tuple[Array, Array, Array]) -> "Samples":
        """Fill the rows of A, S, Q (N, n, n)."""
        A, S, Q = coefficients
        return cls(fill_rows(A), fill_rows(S), fill_rows(Q), len(A))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Times, states and numbers in a row."""
        return self.count, self.A.shape[1], self.A.shape[2]

    def every(self, step: int, first: int = 0) -> "Samples":
        """The samples at every step-th time."""
        A, S, Q = (one[first::step] if len(one) > 1 else one for one in (self.A, self.S, self.Q))
        return Samples(A, S, Q, self.count // step)

    def places(self) -> tuple[int, ...]:
        """Where A, S and Q stand, and the numbers from one sample to the next."""
        found: list[int] = []
        for one in (self.A, self.S, self.Q):
            found += [one.ctypes.data, one.strides[0] // one.itemsize if len(one) > 1 else 0]
        return tuple(found)


def fill_rows(values: Array) -> Array:
    """Return matrices (N, n, n) in rows filled up with zeros (N, n, w); the one matrix of a constant once."""
    values = values[:1] if values.strides[0] == 0 else values
    count, n, _ = values.shape
    filled = np.zeros((count, n, -(-n // ROW) * ROW))
    filled[:, :, :n] = values
    return filled


def sweep_back(
    library: ctypes.CDLL, samples: Samples, step: float, order: int, X: Array
) -> tuple[Array, Array, Array]:
    """Sweep from X (p, n, w) at the first nodes of the next period, p the order, to t = 0, by Adams' predictor and corrector.

    Returns: X at the nodes, the first as it was given (N, n, w); X where the sweep ends, at 0 (n, w); the transition matrices
    Phi(T, t) of the loop A - S X from the first nodes to T, to second order (p, n, w).
    """
    count, n, width = samples.shape
    swept, end, Phi = np.empty(samples.shape), np.empty((n, width)), np.empty((order, n, width))
    swept[: len(X)] = X
    into = (swept.ctypes.data, end.ctypes.data, Phi.ctypes.data)
    library.sweep(n, width, count, order, step, adams_weights(order).ctypes.data, *samples.places(), *into)
    return swept, end, Phi


def find_share(library: ctypes.CDLL, samples: Samples, X: Array, slopes: Array, unit: float) -> tuple[float, float]:
    """Return the least r with -r C <= F <= r C at all times, C = Q + X S X, and the largest entry of F.

    F: the residual X' + A' X + X A - X S X + Q of X and its slopes X' (N, n, w), and what rounding may make of it: `unit` times the
    sum of the sizes of its terms. r is infinite where C is not positive.
    """
    count, n, width = samples.shape
    largest = ctypes.c_double()
    places = (X.ctypes.data, slopes.ctypes.data)
    share = library.find_share(n, width, count, *samples.places(), *places, unit, ctypes.byref(largest))
    return share, largest.value
