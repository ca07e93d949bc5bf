"""Smooth functions of an interval held by their values at Chebyshev nodes: derivative, filter, values in between and integrals."""

from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebint

from flexlin.checks import Array
from flexlin.periodic.chebyshev import chebyshev_basis, chebyshev_nodes, chebyshev_transform

KEPT = 2 / 3
"""The part of the Chebyshev coefficients that the filter keeps."""


def sample_interval(count: int, x: Array) -> Array:
    """The matrix from values at the nodes to values at x in [-1, 1]."""
    return chebyshev_basis(x, count) @ chebyshev_transform(count)


def integrate_interval(count: int, x: Array) -> Array:
    """The matrix from values at the nodes to integrals from -1 to x."""
    return chebyshev_basis(x, count + 1) @ chebint(chebyshev_transform(count), lbnd=-1, axis=0)


@lru_cache(maxsize=64)
def filter_interval(count: int, kept: float) -> tuple[Array, Array]:
    """The matrices from values at the nodes to filtered values and their derivatives at the nodes."""
    filtered = chebyshev_transform(count) * (np.arange(count) < kept * count)[:, None]
    x = chebyshev_nodes(count)
    return chebyshev_basis(x, count) @ filtered, chebyshev_basis(x, count - 1) @ chebder(filtered, axis=0)
