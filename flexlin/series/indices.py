"""Multi-indices of a truncated power series, each monomial once, their products, and polynomials: values, Kronecker layout, CasADi."""

from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, check_size, real_array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.summary import represent

UNDIVIDED_VARIABLES = 4
"""Up to so many variables, the monomials of a degree stand in one row."""
LISTED_PRODUCTS = 50_000
"""Products of two coefficients up to which they are listed; more are made by blocks."""
AT_ONCE = 200_000
"""Entries of products before summation that are held at once, so that they stay in the cache."""


@dataclass(frozen=True)
class Pairs:
    """Products a[left] * b[right] that make the coefficients of one degree, grouped by result: group g begins at start[g]."""

    left: Array
    right: Array
    start: Array


class Indices:
    """The multi-indices alpha in n variables with |alpha| <= order: binomial(n + order, order) of them.

    Degrees follow each other. Few variables: within a degree the exponents fall lexicographically. Many variables: they are divided into
    a head y and a tail z, and degree k is a row of matrices, y^beta z^gamma with |beta| = k, k - 1 ... 0; rows beta, columns gamma.

    Parameters: head, tail: numbers of variables; no tail: they are not divided.
    """

    def __init__(self, head: int, tail: int, order: int):
        self.n, self.order = head + tail, order
        self.start = np.array([comb(self.n + k - 1, self.n) if k else 0 for k in range(order + 2)])
        self.size = int(self.start[-1])
        self.divided = tail > 0
        self.kind = np.int8 if order < 100 else np.int64
        self.kept: dict[Any, Array] = {}
        self.head = kept_indices(head, 0, order) if self.divided else self
        self.tail = kept_indices(tail if self.divided else 0, 0, order) if self.n else self

    def __reduce__(self) -> tuple:
        return kept_indices, (self.n - self.tail.n, self.tail.n, self.order)

    def degree(self, k: int) -> slice:
        """Where the monomials of degree k stand."""
        return slice(int(self.start[k]), int(self.start[k + 1]))

    def width(self, k: int) -> int:
        """Return how many monomials have degree k."""
        return int(self.start[k + 1] - self.start[k])

    @lazy
    def tabulated(self) -> bool:
        """Whether products are few enough to be listed one by one."""
        return self.n <= UNDIVIDED_VARIABLES or comb(2 * self.n + self.order, self.order) <= LISTED_PRODUCTS

    def blocks(self, k: int, part: Array) -> list[Array]:
        """Return views of a part of degree k as its matrices, by the degree 0 ... k of the head's factor."""
        shapes = [(self.head.width(d), self.tail.width(k - d)) for d in range(k, -1, -1)]
        pieces = np.split(part, np.cumsum([rows * columns for rows, columns in shapes[:-1]], dtype=int))
        return [piece.reshape(shape) for piece, shape in zip(pieces, shapes, strict=True)][::-1]

    @lazy
    def powers(self) -> Array:
        """alpha itself for each monomial (size, n)."""
        rows = [self.powers_of(k) for k in range(self.order + 1)]
        return np.concatenate(rows, axis=1).T

    def powers_of(self, k: int) -> Array:
        """Return the exponents of degree k, one row a variable (n, width)."""
        if not self.divided:
            return falling(self.n, k).astype(self.kind)
        pieces = []
        for d in range(k, -1, -1):
            y, z = self.head.powers_of(d), self.tail.powers_of(k - d)
            pieces.append(np.concatenate([np.repeat(y, z.shape[1], axis=1), np.tile(z, y.shape[1])]))
        return np.concatenate(pieces, axis=1)

    def rank(self, powers: Array) -> Array:
        """Return the places of exponents (n, N) of equal degree within that degree (N,).

            rank = sum_i binomial(n - i - 2 + r_i, n - i - 1),   r_i: what is left of the degree behind variable i

        as so many monomials with a larger exponent of variable i, and equal ones before, come first.
        """
        k = int(powers[:, :1].sum())
        if self.divided:
            first, second = powers[: self.head.n], powers[self.head.n :]
            return self.rank_of_product(first, second, k)
        left, places = np.full(powers.shape[1], k), np.zeros(powers.shape[1], dtype=np.intp)
        for i in range(self.n - 1):
            left = left - powers[i]
            places += np.array([comb(self.n - i - 2 + r, self.n - i - 1) if r else 0 for r in range(k + 1)])[left]
        return places

    def rank_of_product(self, first: Array, second: Array, k: int) -> Array:
        """Return the places of y^first z^second within degree k."""
        degrees = first.sum(axis=0, dtype=np.intp)
        widths = [self.head.width(d) * self.tail.width(k - d) for d in range(k + 1)]
        before = np.cumsum([0, *widths[:0:-1]])[::-1]
        places = np.empty(first.shape[1], dtype=np.intp)
        for d in range(k + 1):
            where = np.flatnonzero(degrees == d)
            if len(where):
                rows, columns = self.head.rank(first[:, where]), self.tail.rank(second[:, where])
                places[where] = before[d] + rows * self.tail.width(k - d) + columns
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
            a, b = self.powers_of(i), self.powers_of(j)
            places = self.rank((a[:, :, None] + b[:, None, :]).reshape(self.n, a.shape[1] * b.shape[1]))
            self.kept[i, j] = places.astype(np.int32).reshape(a.shape[1], -1)
        return self.kept[i, j]

    @lru_cache(maxsize=64)  # noqa: B019  an Indices lives as long as its cache in `indices`
    def pairs(self, k: int) -> Pairs:
        """All products that give degree k."""
        blocks = []
        for i in range(k + 1):
            a, b = (np.arange(self.start[d], self.start[d + 1]) for d in (i, k - i))
            blocks.append((self.sums(i, k - i).ravel(), np.repeat(a, len(b)), np.tile(b, len(a))))
        result, left, right = (np.concatenate(column) for column in zip(*blocks, strict=True))
        sequence = np.argsort(result, kind="stable")
        start = np.searchsorted(result[sequence], np.arange(self.width(k)))
        return Pairs(left[sequence], right[sequence], start)

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
        if self.divided:
            y, z = self.head.monomials(x[..., : self.head.n]), self.tail.monomials(x[..., self.head.n :])
        for k in range(1, self.order + 1):
            where = self.degree(k)
            if not self.divided:
                np.multiply(values[..., self.parent[where]], x[..., self.last[where]], out=values[..., where])
                continue
            begin = where.start
            for d in range(k, -1, -1):
                block = y[..., self.head.degree(d), None] * z[..., None, self.tail.degree(k - d)]
                end = begin + block.shape[-1] * block.shape[-2]
                values[..., begin:end] = block.reshape(*x.shape[:-1], -1)
                begin = end
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
def kept_indices(head: int, tail: int, order: int) -> Indices:
    """Return the kept Indices of a head and a tail of so many variables."""
    return Indices(head, tail, order)


def head_of(n: int) -> int:
    """Return how many of n variables are the head."""
    return n if n <= UNDIVIDED_VARIABLES else (n + 2) // 2


def shared_indices(n: int, order: int) -> Indices:
    """Return the kept Indices of n variables and this order."""
    return kept_indices(head_of(n), n - head_of(n), order)


def indices(n: int, order: int, series: int) -> Indices:
    """Return the multi-indices for a computation whose series take so many bytes, or refuse.

    Raises: ArgumentError on a negative order; TooLarge when series and product tables need an unreasonable number of bytes.
    """
    if order < 0 or n < 1:
        raise ArgumentError("a series needs variables and an order", got=(n, order), expected="n >= 1, order >= 0")
    size = series + 32 * (comb(2 * n + order, order) if n <= UNDIVIDED_VARIABLES else comb(n + 2 + order, order))
    check_size(
        f"a series of order {order} in {n} variables", size, "lower the order, or take a series in one direction"
    )
    return shared_indices(n, order)


def sum_products(indices: Indices, a: Array, b: Array, k: int, weights: Array) -> Array:
    """Return sum_i weights_i a_i b_(k-i) of two series in many variables, leaving out parts that are zero.

    Products of homogeneous parts are those of small matrices, and no list of index pairs is kept.
    """
    total = np.zeros(indices.width(k), dtype=np.result_type(a, b))
    for i in range(k + 1):
        left, right = a[indices.degree(i)], b[indices.degree(k - i)]
        if weights[i] and left.any() and right.any():
            total += multiply_parts(indices, weights[i] * left, i, right, k - i)
    return total


def multiply_parts(indices: Indices, a: Array, i: int, b: Array, j: int) -> Array:
    """Return the product of a part of degree i and one of degree j (width of degree i + j,)."""
    if i == 0 or j == 0:
        return a * b
    total = np.zeros(indices.width(i + j), dtype=np.result_type(a, b))
    into = indices.blocks(i + j, total)
    right = [occupied_rows(B) for B in indices.blocks(j, b)]
    for d, (rows, A) in enumerate(occupied_rows(A) for A in indices.blocks(i, a)):
        for e, (others, B) in enumerate(right):
            if len(rows) and len(others):
                places = indices.head.sums(d, e)[np.ix_(rows, others)]
                add_product(into[d + e], places, indices.tail, (A, i - d), (B, j - e))
    return total


def occupied_rows(A: Array) -> tuple[Array, Array]:
    """Return which rows are not zero, and these rows."""
    rows = np.flatnonzero(A.any(axis=1))
    return rows, A if len(rows) == len(A) else A[rows]


def add_product(into: Array, places: Array, tail: Indices, a: tuple[Array, int], b: tuple[Array, int]) -> None:
    """Add A_alpha * B_beta to row places[alpha, beta] for all rows alpha and beta.

    Parameters: a, b: rows with their degree in z. The one of lower degree is spread over the quotients of monomials by its own.
    """
    (A, m), (B, n) = a, b
    if m < n:
        (A, m), (B, n), places = (B, n), (A, m), places.T
    if n == 0:
        add_rows(into, places.ravel(), np.tile(B[:, 0], len(A)), A)
        return
    step = max(1, AT_ONCE // (len(B) * into.shape[1]))
    table = differences(tail, n, m)
    for first in range(0, len(A), step):
        rows = A[first : first + step]
        padded = np.concatenate([rows, np.zeros((len(rows), 1), dtype=rows.dtype)], axis=1)
        products = np.matmul(B, np.take(padded, table, axis=1, mode="clip")).reshape(-1, into.shape[1])
        where = places[first : first + step].ravel()
        add_rows(into, where, np.ones(len(where), dtype=products.dtype), products)


def add_rows(into: Array, where: Array, weights: Array, rows: Array) -> None:
    """Add each row to as many places as there are for it, times weights."""
    from scipy.sparse import csc_array  # takes longer to load than short series to multiply

    ends = np.arange(0, len(where) + 1, len(where) // len(rows))
    into += csc_array((weights, where, ends), shape=(len(into), len(rows))) @ rows


def differences(tail: Indices, n: int, m: int) -> Array:
    """Return the place within degree m of monomial nu of degree n + m over mu of degree n, one behind the last where mu does not divide nu.

    Returns: (width_n, width_(n + m)).
    """
    if ("over", n, m) not in tail.kept:
        table = np.full((tail.width(n), tail.width(n + m)), tail.width(m), dtype=np.intp)
        np.put_along_axis(table, tail.sums(n, m).astype(np.intp), np.arange(tail.width(m))[None, :], axis=1)
        tail.kept["over", n, m] = table
    return tail.kept["over", n, m]


@dataclass(frozen=True)
class Polynomial:
    """p(dx) = sum_alpha c_alpha dx^alpha, |alpha| <= order, for several outputs.

    Parameters: indices; coefficients (size, outputs).
    """

    indices: Indices
    coefficients: Array

    __repr__ = represent

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
