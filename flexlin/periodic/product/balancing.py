"""Products of many factors without loss: one scaling that evens rows and columns."""

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import LAPACK

GROUP_CONDITION = 1000.0
"""Factors are multiplied together while the product's condition number stays below this: the weakest mode loses three digits."""


def balance_factors(factors: Array) -> tuple[Array, Array]:
    """Return S^-1 F_k S and the diagonal of S, one scaling by powers of two that evens rows and columns of sum |F_k|."""
    n = factors.shape[-1]
    scale = LAPACK.dgebal(np.abs(factors).sum(axis=0), scale=1, permute=0)[3]
    if n == 1 or np.all(scale == 1):
        return factors, np.ones(n)
    return factors * (scale / scale[:, None]), scale
