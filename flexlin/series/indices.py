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

TABLES = 50_000
"""Products of two coefficients up to which they are listed one by one; more are made by blocks."""
AT_ONCE = 100_000
"""Products that are held at once before they are summed, so that they stay in the cache."""


@dataclass(frozen=True)
class Pairs:
    """Products a[left] * b[right] that make the coefficients of one degree, grouped by result: group g begins at start[g]."""

    left: Array
    right: Array
    start: Array


class Indices:
    """The multi-indices alpha in n variables with |alpha| <= order: binomial(n + order, order) of them.

    Degrees follow each other; within a degree the exponents fall lexicographically. Each monomial but the constant is its `parent`,
    one degree lower, times x_i with i = `last`, which is no variable before those of the parent.
    """

    def __init__(self, n: int, order: int):
        self.n, self.order = n, order
        self.start = np.array([comb(n + k - 1, n) if k else 0 for k in range(order + 2)])
        self.size = int(self.start[-1])
        self.kept: dict[Any, Any] = {}
        parents, last = [np.zeros(1, dtype=np.int32)], [np.zeros(1, dtype=np.int32)]  # 0 for the constant
        for k in range(order):
            times = n - last[k]
            parents.append(np.repeat(np.arange(self.start[k], self.start[k + 1], dtype=np.int32), times))
            runs = np.arange(len(parents[-1])) - np.repeat(np.cumsum(times) - times, times)
            last.append((np.repeat(last[k], times) + runs).astype(np.int32))
        self.parent, self.last = np.concatenate(parents), np.concatenate(last)

    def __reduce__(self) -> tuple:
        return shared_indices, (self.n, self.order)

    def degree(self, k: int) -> slice:
        """Where the monomials of degree k stand."""
        return slice(int(self.start[k]), int(self.start[k + 1]))

    def width(self, k: int) -> int:
        """Return how many monomials have degree k."""
        return int(self.start[k + 1] - self.start[k])

    @lazy
    def tabulated(self) -> bool:
        """Whether products are few enough to be listed one by one."""
        return comb(2 * self.n + self.order, self.order) <= TABLES

    @lazy
    def up(self) -> Array:
        """The place of each monomial below the order times each variable (size below, n)."""
        parent, last = self.parent, self.last
        table = np.zeros((int(self.start[self.order]), self.n), dtype=np.int32)
        if self.order:
            table[parent[1:], last[1:]] = np.arange(1, self.size)
        for k in range(1, self.order):
            for v in range(self.n - 1):
                m = self.start[k] + np.flatnonzero(last[self.degree(k)] > v)
                table[m, v] = table[table[parent[m], v], last[m]]
        return table

    @lazy
    def powers(self) -> Array:
        """alpha itself for each monomial (size, n)."""
        found = np.zeros((self.size, self.n), dtype=np.int64)
        for k in range(1, self.order + 1):
            where = np.arange(self.start[k], self.start[k + 1])
            found[where] = found[self.parent[where]]
            found[where, self.last[where]] += 1
        return found

    def places_of(self, own: "Indices", among: tuple[int, ...]) -> Array:
        """The places of the monomials of `own`, whose variables are those `among` these ones (size of own,)."""
        if ("among", among) not in self.kept:
            places, variables = np.zeros(own.size, dtype=np.intp), np.array(among, dtype=np.intp)
            for k in range(1, self.order + 1 if own.n else 1):
                where = own.degree(k)
                places[where] = self.up[places[own.parent[where]], variables[own.last[where]]]
            self.kept["among", among] = places
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
        if i > j:
            return self.sums(j, i).T
        if (i, j) not in self.kept:
            own = self.degree(i)
            if i:
                below = self.sums(i - 1, j)[self.parent[own] - self.start[i - 1]] + self.start[i + j - 1]
                table = self.up[below, self.last[own, None]] - self.start[i + j]
            else:
                table = np.arange(self.width(j))[None]
            self.kept[i, j] = table.astype(np.int32)
        return self.kept[i, j]

    def pairs(self, k: int) -> Pairs:
        """All products that give degree k."""
        if ("pairs", k) not in self.kept:
            blocks = []
            for i in range(k + 1):
                a, b = (np.arange(self.start[d], self.start[d + 1]) for d in (i, k - i))
                blocks.append((self.sums(i, k - i).ravel(), np.repeat(a, len(b)), np.tile(b, len(a))))
            result, left, right = (np.concatenate(column) for column in zip(*blocks, strict=True))
            sequence = np.argsort(result, kind="stable")
            start = np.searchsorted(result[sequence], np.arange(self.width(k)))
            self.kept["pairs", k] = Pairs(left[sequence], right[sequence], start)
        return self.kept["pairs", k]

    def sum_products(self, a: Array, b: Array, k: int, weights: Array) -> Array:
        """Return sum_i weights_i a_i b_(k-i) of two series of numbers; parts of the same two degrees share a table."""
        total = np.zeros(self.width(k), dtype=np.result_type(a, b))
        for i in range(k // 2 + 1):
            low, high = self.degree(i), self.degree(k - i)
            terms = [(weights[i] * a[low], b[high])] + [(weights[k - i] * b[low], a[high])] * (2 * i < k)
            terms = [(x, y) for x, y in terms if x.any() and y.any()]
            if terms:
                left, right = zip(*terms, strict=True)
                add_products(total, self.sums(i, k - i), np.stack(left, axis=1), np.stack(right))
        return total

    def dense(self, k: int) -> Array:
        """The place of the monomial of each column (i_1 ... i_k) of the Kronecker layout, i_k fastest (n^k,)."""
        table = np.zeros(1, dtype=np.intp)
        for _ in range(k):
            table = self.up[table].ravel()
        return table

    def monomials(self, x: Array) -> Array:
        """All monomials at points x (n,) or (N, n): (size,) or (N, size)."""
        values = np.empty((self.size, *x.T.shape[1:]), dtype=x.dtype)
        values[0] = 1.0
        for k in range(1, self.order + 1):
            where = self.degree(k)
            np.take(values, self.parent[where], axis=0, out=values[where])
            values[where] *= np.take(x.T, self.last[where], axis=0)
        return values.T


def add_products(into: Array, places: Array, left: Array, right: Array) -> None:
    """Add (left @ right)_mn to into at places_mn, some rows at a time."""
    rows = max(1, AT_ONCE // places.shape[1])
    for first in range(0, len(places), rows):
        where, values = places[first : first + rows].ravel(), (left[first : first + rows] @ right).ravel()
        into += np.bincount(where, values.real, len(into))
        if np.iscomplexobj(values):
            into += 1j * np.bincount(where, values.imag, len(into))


@lru_cache(maxsize=128)
def shared_indices(n: int, order: int) -> Indices:
    """Return the kept Indices of n variables and this order."""
    return Indices(n, order)


def indices(n: int, order: int, series: int) -> Indices:
    """Return the multi-indices for a computation whose series take so many bytes, or refuse.

    Raises: ArgumentError on a negative order; TooLarge when series and product tables need an unreasonable number of bytes.
    """
    if order < 0 or n < 1:
        raise ArgumentError("a series needs variables and an order", got=(n, order), expected="n >= 1, order >= 0")
    products = comb(2 * n + order, order)
    size = series + (32 if products <= TABLES else 2) * products
    check_size(
        f"a series of order {order} in {n} variables", size, "lower the order, or take a series in one direction"
    )
    return shared_indices(n, order)


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
        """Return the polynomial as a CasADi column (outputs, 1) of dx, shared monomials computed once."""
        monomials = symbolic_monomials(self.indices, dx)
        return weighted_sums(self.coefficients.T, monomials)


def symbolic_monomials(indices: Indices, dx: Any) -> list[Any]:
    """Return all monomials of a CasADi column."""
    monomials: list[Any] = [ca.SX(1)]
    for parent, last in zip(indices.parent[1:], indices.last[1:], strict=True):
        monomials.append(monomials[parent] * dx[int(last)])
    return monomials


def weighted_sums(weights: Array, monomials: list[Any]) -> ca.SX:
    """Return weights @ monomials as a CasADi column, leaving zero weights out; weights: numbers or CasADi scalars (rows, size)."""
    rows = []
    for row in weights.tolist():
        pairs = zip(row, monomials, strict=True)
        rows.append(sum((weight * monomial for weight, monomial in pairs if not is_zero(weight)), ca.SX(0)))
    return ca.densify(ca.vertcat(*rows))


def is_zero(value: Any) -> bool:
    """Whether a number or a CasADi scalar is known to be 0."""
    return bool(value.is_zero() if isinstance(value, ca.SX) else value == 0)
