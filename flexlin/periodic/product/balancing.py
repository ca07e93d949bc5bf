"""Products of many factors without loss: balancing, grouping while well conditioned, and rescaled products."""

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import LAPACK

GROUP_CONDITION = 1000.0
"""Factors are multiplied together while the product's condition number stays below this: the weakest mode loses three digits."""
LARGEST = 1e70
"""Products keep their entries within this and its inverse: modes that all grow alike are well conditioned, and yet overflow."""


def balance_factors(factors: Array) -> tuple[Array, Array]:
    """Return S^-1 F_k S and the diagonal of S, one scaling by powers of two that evens rows and columns of sum |F_k|."""
    n = factors.shape[-1]
    scale = LAPACK.dgebal(np.abs(factors).sum(axis=0), scale=1, permute=0)[3]
    if n == 1 or np.all(scale == 1):
        return factors, np.ones(n)
    return factors * (scale / scale[:, None]), scale


def count_groupings(factors: Array, limit: float = GROUP_CONDITION) -> tuple[Array, int]:
    """Multiply neighbours, F_(k+1) F_k, again and again while every product's condition number stays below a limit.

    No product leaves the range in which squares of products are numbers.

    Parameters: factors (K, n, n), the first acts first. Returns: (K', n, n) with the same product, and how often pairs were made.
    """
    rounds = 0
    while len(factors) > 1:
        pairs = multiply_pairs(factors)
        size = np.abs(pairs).max(axis=(-2, -1))
        if not (size.max() < LARGEST and size.min() > 1 / LARGEST and measure_condition(pairs) <= limit):
            break
        factors, rounds = pairs, rounds + 1
    return factors, rounds


def group_factors(factors: Array) -> Array:
    """The factors multiplied together while that costs the weakest mode no more than log10 GROUP_CONDITION digits."""
    return count_groupings(factors)[0]


def multiply_pairs(factors: Array) -> Array:
    """The products F_1 F_0, F_3 F_2, ...; an odd last factor stays as it is."""
    even = len(factors) - len(factors) % 2
    pairs = factors[1:even:2] @ factors[0:even:2]
    return pairs if even == len(factors) else np.concatenate([pairs, factors[-1:]])


def measure_condition(matrices: Array) -> float:
    """The largest condition number of a batch in the 1-norm; infinite when one is singular."""
    try:
        inverses = np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        return float("inf")
    return float((np.abs(matrices).sum(axis=-2).max(axis=-1) * np.abs(inverses).sum(axis=-2).max(axis=-1)).max())


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
