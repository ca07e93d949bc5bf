"""Products of many factors without loss: one scaling that evens rows and columns, pairs, and rescaled products."""

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


def multiply_pairs(factors: Array) -> Array:
    """The products F_1 F_0, F_3 F_2, ...; an odd last factor stays as it is."""
    even = len(factors) - len(factors) % 2
    pairs = factors[1:even:2] @ factors[0:even:2]
    return pairs if even == len(factors) else np.concatenate([pairs, factors[-1:]])


def multiply_scaled(factors: Array) -> tuple[Array, float]:
    """The product F_(K-1) ... F_0 as (P, s) with P exp(s): neither overflows nor underflows."""
    log_scale = 0.0
    while True:
        size = np.abs(factors).max(axis=(-2, -1), keepdims=True)
        size[size == 0] = 1
        factors, log_scale = factors / size, log_scale + float(np.log(size).sum())
        if len(factors) == 1:
            return factors[0], log_scale
        factors = multiply_pairs(factors)
