"""Smooth functions of an interval held by their values at Chebyshev nodes: derivative, filter, values in between and integrals."""

from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebint, chebvander

from flexlin.checks import Array

KEPT = 2 / 3
"""The part of the Chebyshev coefficients that the filter keeps."""


@lru_cache(maxsize=64)
def chebyshev_nodes(count: int) -> Array:
    """Chebyshev nodes of the first kind in (-1, 1), increasing: no end of the interval is among them."""
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


@lru_cache(maxsize=64)
def coefficients(count: int) -> Array:
    """The matrix from values at the nodes to Chebyshev coefficients, by discrete orthogonality."""
    rows = 2 / count * chebvander(chebyshev_nodes(count), count - 1).T
    rows[0] /= 2
    return rows


def values_at(count: int, x: Array) -> Array:
    """The matrix from values at the nodes to values at x in [-1, 1]."""
    return chebvander(x, count - 1) @ coefficients(count)


def integrals_to(count: int, x: Array) -> Array:
    """The matrix from values at the nodes to integrals from -1 to x."""
    return chebvander(x, count) @ chebint(coefficients(count), lbnd=-1, axis=0)


@lru_cache(maxsize=64)
def slopes(count: int, kept: float) -> tuple[Array, Array]:
    """The matrices from values at the nodes to filtered values and their derivatives at the nodes."""
    filtered = coefficients(count) * (np.arange(count) < kept * count)[:, None]
    x = chebyshev_nodes(count)
    return chebvander(x, count - 1) @ filtered, chebvander(x, count - 2) @ chebder(filtered, axis=0)
