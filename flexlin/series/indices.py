"""Multi-indices of a truncated power series: each monomial once, ordered by degree."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError


@dataclass(frozen=True)
class Pairs:
    """Products a[left] * b[right] that make the coefficients of one degree, grouped by result: group g begins at start[g]."""

    left: Array
    right: Array
    start: Array


class Indices:
    """The multi-indices alpha in n variables with |alpha| <= order: binomial(n + order, order) of them.

    A monomial is known by the sorted tuple of its factors, such as (0, 0, 1) for x0^2 x1; degrees follow each other.
    """

    def __init__(self, n: int, order: int):
        self.n, self.order = n, order
        self.factors = [t for k in range(order + 1) for t in combinations_with_replacement(range(n), k)]
        self.start = np.array([comb(n + k - 1, n) if k else 0 for k in range(order + 2)])
        self.size = len(self.factors)

    def degree(self, k: int) -> slice:
        """Where the monomials of degree k stand."""
        return slice(int(self.start[k]), int(self.start[k + 1]))

    @cached_property
    def up(self) -> Array:
        """up[i, j]: the place of monomial i times x_j, for i of degree below the order (rows, n)."""
        place = {t: i for i, t in enumerate(self.factors)}
        below = self.factors[: self.start[self.order]]
        table = [[place[tuple(sorted((*t, j)))] for j in range(self.n)] for t in below]
        return np.array(table, dtype=np.intp).reshape(len(below), self.n)

    @cached_property
    def powers(self) -> Array:
        """alpha itself for each monomial (size, n)."""
        return np.array([np.bincount(t, minlength=self.n) for t in self.factors], dtype=int).reshape(self.size, self.n)

    @cached_property
    def degrees(self) -> Array:
        """|alpha| for each monomial (size,)."""
        return self.powers.sum(axis=1)

    @cached_property
    def factorials(self) -> Array:
        """alpha! for each monomial (size,)."""
        return np.cumprod(np.maximum(1, np.arange(self.order + 1.0)))[self.powers].prod(axis=1)

    @lru_cache(maxsize=64)  # noqa: B019  an Indices lives as long as its cache in `indices`
    def pairs(self, k: int) -> Pairs:
        """All products that give degree k."""
        blocks = []
        for i in range(k + 1):
            a, b = (np.arange(self.start[d], self.start[d + 1]) for d in (i, k - i))
            left, right = np.repeat(a, len(b)), np.tile(b, len(a))
            result = left
            for step in np.array([self.factors[j] for j in b], dtype=np.intp).reshape(len(b), k - i).T:
                result = self.up[result, np.tile(step, len(a))]
            blocks.append((result, left, right))
        result, left, right = (np.concatenate(column) for column in zip(*blocks, strict=True))
        sequence = np.argsort(result, kind="stable")
        start = np.searchsorted(result[sequence], np.arange(self.start[k], self.start[k + 1]))
        return Pairs(left[sequence], right[sequence], start)

    def dense(self, k: int) -> Array:
        """The place of the monomial of each column (i_1 ... i_k) of the Kronecker layout, i_k fastest (n^k,)."""
        table = np.zeros(1, dtype=np.intp)
        for _ in range(k):
            table = self.up[table].ravel()
        return table

    def monomials(self, x: Array) -> Array:
        """All monomials at points x (..., n): (..., size)."""
        values = np.empty((*x.shape[:-1], self.size), dtype=x.dtype)
        values[..., 0] = 1.0
        for k in range(1, self.order + 1):
            values[..., self.degree(k)] = values[..., self.parent[self.degree(k)]] * x[..., self.last[self.degree(k)]]
        return values

    @cached_property
    def last(self) -> Array:
        """The last factor of each monomial (size,), 0 for the constant."""
        return np.array([t[-1] if t else 0 for t in self.factors], dtype=np.intp)

    @cached_property
    def parent(self) -> Array:
        """The place of each monomial without its last factor (size,)."""
        place = {t: i for i, t in enumerate(self.factors)}
        return np.array([place[t[:-1]] for t in self.factors], dtype=np.intp)


@lru_cache(maxsize=32)
def shared_indices(n: int, order: int) -> Indices:
    """Return the kept Indices of n variables and this order."""
    return Indices(n, order)


def indices(n: int, order: int, numbers: int) -> Indices:
    """Return the multi-indices for a computation that holds `numbers` series, or refuse.

    Raises: ArgumentError on a negative order; TooLarge when series and product tables need an unreasonable number of bytes.
    """
    if order < 0 or n < 1:
        raise ArgumentError("a series needs variables and an order", got=(n, order), expected="n >= 1, order >= 0")
    size = 8 * (numbers * comb(n + order, n) + 4 * comb(2 * n + order, order))
    check_size(
        f"a series of order {order} in {n} variables", size, "lower the order, or take a series in one direction"
    )
    return shared_indices(n, order)
