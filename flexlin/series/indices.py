"""Multi-indices of a truncated power series, each monomial once, their products, and polynomials: values, Kronecker layout, CasADi."""

from functools import lru_cache
from math import comb
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, check_size, real_array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.summary import immutable

LISTED_PRODUCTS = 50_000
"""Products of two coefficients up to which they are listed; of more only the places in which they are summed are kept."""


class Indices:
    """The multi-indices alpha in n variables with |alpha| <= order: binomial(n + order, order) of them.

    Degrees follow each other; within a degree the exponents fall lexicographically.
    """

    def __init__(self, n: int, order: int):
        self.n, self.order = n, order
        self.start = np.array([comb(n + k - 1, n) if k else 0 for k in range(order + 2)])
        self.size = int(self.start[-1])
        self.kind = np.int8 if order < 100 else np.int64
        self.kept: dict[Any, Array] = {}

    def __reduce__(self) -> tuple:
        return kept_indices, (self.n, self.order)

    def degree(self, k: int) -> slice:
        """Where the monomials of degree k stand."""
        return slice(int(self.start[k]), int(self.start[k + 1]))

    def width(self, k: int) -> int:
        """Return how many monomials have degree k."""
        return int(self.start[k + 1] - self.start[k])

    @lazy
    def tabulated(self) -> bool:
        """Whether products are few enough to be listed one by one."""
        return comb(2 * self.n + self.order, self.order) <= LISTED_PRODUCTS

    @lazy
    def powers(self) -> Array:
        """alpha itself for each monomial (size, n)."""
        rows = [self.powers_of(k) for k in range(self.order + 1)]
        return np.concatenate(rows, axis=1).T

    def powers_of(self, k: int) -> Array:
        """Return the exponents of degree k, one row a variable (n, width)."""
        return falling(self.n, k).astype(self.kind)

    def rank(self, powers: Array) -> Array:
        """Return the places of exponents (n, N) of equal degree within that degree (N,).

            rank = sum_i binomial(n - i - 2 + r_i, n - i - 1),   r_i: what is left of the degree behind variable i

        as so many monomials with a larger exponent of variable i, and equal ones before, come first.
        """
        k = int(powers[:, :1].sum())
        left, places = np.full(powers.shape[1], k), np.zeros(powers.shape[1], dtype=np.intp)
        for i in range(self.n - 1):
            left = left - powers[i]
            places += np.array([comb(self.n - i - 2 + r, self.n - i - 1) if r else 0 for r in range(k + 1)])[left]
        return places

    def places_of(self, own: "Indices", among: tuple[int, ...]) -> Array:
        """The places of the monomials of `own`, whose variables are those `among` these ones (size of own,)."""
        if ("among", among) not in self.kept:
            places = [np.zeros(1, dtype=np.intp)]
            for k in range(1, self.order + 1 if own.n else 1):
                powers = np.zeros((self.n, own.width(k)), dtype=self.kind)
                powers[list(among)] = own.powers_of(k)
                places.append(self.start[k] + self.rank(powers))
            self.kept["among", among] = np.concatenate(places)
        return self.kept["among", among]

    @lazy
    def degrees(self) -> Array:
        """|alpha| for each monomial (size,)."""
        return np.repeat(np.arange(self.order + 1), np.diff(self.start))

    @lazy
    def factorials(self) -> Array:
        """alpha! for each monomial (size,)."""
        return np.cumprod(np.maximum(1, np.arange(self.order + 1.0)))[self.powers].prod(axis=1)

    def sums(self, i: int, j: int) -> Array:
        """Return the place, within degree i + j, of each product of monomials of degree i and j (width_i, width_j)."""
        if (i, j) not in self.kept:
            if j < 2:
                raised = self.powers_of(i)[:, :, None] + self.powers_of(j)[:, None, :]
                places = self.rank(raised.reshape(self.n, raised.shape[1] * raised.shape[2])).reshape(raised.shape[1:])
            else:  # by all but the last factor, then by that
                before = self.sums(i, j - 1)[:, self.parent[self.degree(j)] - self.start[j - 1]]
                places = self.sums(i + j - 1, 1)[before, self.last[self.degree(j)]]
            self.kept[i, j] = places.astype(np.int32)
        return self.kept[i, j]

    @lru_cache(maxsize=64)  # noqa: B019  an Indices lives as long as its cache in `indices`
    def pairs(self, k: int) -> tuple[Array, Array, Array]:
        """Products a[left] * b[right] that give degree k, grouped by result: group g begins at start[g]."""
        blocks = []
        for i in range(k + 1):
            a, b = (np.arange(self.start[d], self.start[d + 1]) for d in (i, k - i))
            blocks.append((self.sums(i, k - i).ravel(), np.repeat(a, len(b)), np.tile(b, len(a))))
        result, left, right = (np.concatenate(column) for column in zip(*blocks, strict=True))
        sequence = np.argsort(result, kind="stable")
        start = np.searchsorted(result[sequence], np.arange(self.width(k)))
        return left[sequence], right[sequence], start

    def dense(self, k: int) -> Array:
        """The place of the monomial of each column (i_1 ... i_k) of the Kronecker layout, i_k fastest (n^k,)."""
        table = np.zeros(1, dtype=np.intp)
        for j in range(k):
            table = self.sums(j, 1)[table].ravel()
        return table + self.start[k]

    def monomials(self, x: Array) -> Array:
        """All monomials at points x (..., n): (..., size)."""
        values = np.empty((*x.shape[:-1], self.size), dtype=x.dtype)
        values[..., 0] = 1.0
        for where in map(self.degree, range(1, self.order + 1)):
            np.multiply(values[..., self.parent[where]], x[..., self.last[where]], out=values[..., where])
        return values

    @lazy
    def last(self) -> Array:
        """The last factor of each monomial (size,), 0 for the constant."""
        return self.n - 1 - np.argmax(self.powers[:, ::-1] > 0, axis=1) if self.order else np.zeros(1, dtype=np.intp)

    @lazy
    def parent(self) -> Array:
        """The place of each monomial without its last factor (size,)."""
        places = [np.zeros(1, dtype=np.intp)]
        for k in range(1, self.order + 1):
            less = self.powers_of(k)
            less[self.last[self.degree(k)], np.arange(less.shape[1])] -= 1
            places.append(self.start[k - 1] + self.rank(less))
        return np.concatenate(places)


@lru_cache(maxsize=64)
def falling(n: int, k: int) -> Array:
    """Return the exponents of degree k in n variables, falling lexicographically (n, binomial(n + k - 1, k))."""
    if n <= 1:
        return np.full((n, 1 if n or not k else 0), k)
    rest = [falling(n - 1, m) for m in range(k + 1)]
    return np.concatenate(
        [np.concatenate([np.full((1, one.shape[1]), k - m), one]) for m, one in enumerate(rest)], axis=1
    )


@lru_cache(maxsize=128)
def kept_indices(n: int, order: int) -> Indices:
    """Return the kept Indices of n variables and this order."""
    return Indices(n, order)


def indices(n: int, order: int, series: int) -> Indices:
    """Return the multi-indices for a computation whose series take so many bytes, or refuse.

    Raises: ArgumentError on a negative order; TooLarge when series and product tables need an unreasonable number of bytes.
    """
    if order < 0 or n < 1:
        raise ArgumentError("a series needs variables and an order", got=(n, order), expected="n >= 1, order >= 0")
    size = series + 8 * comb(2 * n + order, order)  # places of sums are kept, and at most as much is at work
    check_size(
        f"a series of order {order} in {n} variables", size, "lower the order, or take a series in one direction"
    )
    return kept_indices(n, order)


def sum_products(indices: Indices, a: Array, b: Array, k: int, weights: Array) -> Array:
    """Return sum_i weights_i a_i b_(k-i) of two real series in many variables, leaving out coefficients that are zero."""
    total = np.zeros(indices.width(k))
    for i in np.flatnonzero(weights).tolist():
        left, right = weights[i] * a[indices.degree(i)], b[indices.degree(k - i)]
        rows, columns = np.flatnonzero(left), np.flatnonzero(right)
        places = indices.sums(i, k - i)[np.ix_(rows, columns)]
        total += np.bincount(places.ravel(), np.outer(left[rows], right[columns]).ravel(), len(total))
    return total


@immutable
class Polynomial:
    """p(dx) = sum_alpha c_alpha dx^alpha, |alpha| <= order, for several outputs.

    Parameters: indices; coefficients (size, outputs).
    """

    indices: Indices
    coefficients: Array

    def __call__(self, dx: ArrayLike) -> Array:
        """Return the values (..., outputs) at dx (n,) or (N, n)."""
        n = self.indices.n
        points = real_array("dx", dx, (None, n) if np.ndim(dx) == 2 else (n,))
        return self.indices.monomials(points) @ self.coefficients

    def kronecker(self, k: int) -> Array:
        """Return the k-th derivative at the point of evaluation in Kronecker layout.

            D^k p, columns (i_1 ... i_k), i_k fastest:  alpha! c_alpha

        Returns: (outputs, n^k).
        Raises: ArgumentError when k is not in 0 ... order; TooLarge when it would take an unreasonable number of bytes.
        """
        if not 0 <= k <= self.indices.order:
            raise ArgumentError("no such derivative is known", got=k, expected=f"0 to {self.indices.order}")
        size = 8 * self.indices.n**k * (2 + self.coefficients.shape[1])
        check_size(
            f"derivative {k} in Kronecker layout", size, "use the polynomial itself, which holds each derivative once"
        )
        places = self.indices.dense(k)
        return self.coefficients.T[:, places] * self.indices.factorials[places]

    def expression(self, dx: Any) -> ca.SX:
        """Return the polynomial as a CasADi column (outputs, 1) of dx, shared monomials computed once, zeros left out."""
        monomials = [ca.SX(1)]
        for parent, last in zip(self.indices.parent[1:], self.indices.last[1:], strict=True):
            monomials.append(monomials[parent] * dx[int(last)])
        terms = [zip(row, monomials, strict=True) for row in self.coefficients.T.tolist()]
        return ca.densify(ca.vertcat(*[sum((c * m for c, m in pairs if c), ca.SX(0)) for pairs in terms]))
