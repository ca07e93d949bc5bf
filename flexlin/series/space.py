"""Coefficients of truncated series: numbers (real or complex, many points at once) or CasADi scalars, under one arithmetic.

The coefficients of one series are an array (size, ...), a homogeneous part of degree k is its slice `indices.degree(k)`.
Parts not yet computed are zero, so one full convolution serves products, quotients and roots alike.
"""

from collections.abc import Callable
from dataclasses import dataclass
from sys import maxsize

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.series.indices import Indices, kept_indices


@dataclass(frozen=True)
class Embedded:
    """A series in the variables `among` of a larger set, read one degree at a time: E[indices.degree(k)], E[:1].

    Parameters: series in its own indices; indices of the larger set; reach: the highest degree that it may have.
    """

    series: Array
    own: Indices
    indices: Indices
    among: tuple[int, ...]
    reach: int

    def __getitem__(self, where: slice) -> Array:
        k = int(np.searchsorted(self.indices.start, where.start, side="right")) - 1 if where.start else 0
        part = np.zeros(self.indices.width(k), dtype=self.series.dtype)
        if k <= self.reach:
            blocks = self.indices.blocks(k, part), self.own.blocks(k, self.series[self.own.degree(k)])
            first = tuple(i for i in self.among if i < self.indices.head.n)
            second = tuple(i - self.indices.head.n for i in self.among[len(first) :])
            for d, (target, source) in enumerate(zip(*blocks, strict=True)):
                if source.size:
                    rows = places_among(first, self.indices.head, d)
                    target[rows[:, None], places_among(second, self.indices.tail, k - d)] = source
        return part


Coefficients = Array | Embedded
"""A series as it is kept or as it is read."""


def reach(series: Coefficients) -> int:
    """Return a degree above which a series has no part; a large number where that is not known."""
    return series.reach if isinstance(series, Embedded) else maxsize


def whole(series: Coefficients) -> Array:
    """Return all coefficients of a series."""
    if isinstance(series, Embedded):
        return np.concatenate([series[series.indices.degree(k)] for k in range(series.indices.order + 1)])
    return series


def places_among(among: tuple[int, ...], indices: Indices, k: int) -> Array:
    """Return the places within degree k of the monomials in the variables `among`."""
    key = ("among", among, k)
    if key not in indices.kept:
        powers = kept_indices(len(among), 0, indices.order).powers_of(k)
        spread = np.zeros((indices.n, powers.shape[1]), dtype=powers.dtype)
        spread[list(among)] = powers
        indices.kept[key] = indices.rank(spread)
    return indices.kept[key]


def atan2(y: Array, x: Array) -> Array:
    """Return the angle of (x, y), also for complex y and x."""
    if np.iscomplexobj(y) or np.iscomplexobj(x):
        return -1j * np.log((x + 1j * y) / np.sqrt(x * x + y * y))
    return np.arctan2(y, x)


def erf(x: Array) -> Array:
    """Return the error function, also of complex x."""
    from scipy import special

    return np.asarray(special.erf(x))


def less(a: Array, b: Array) -> Array:
    """Return 1 where a < b and 0 where a > b; nan at equality, where a choice between them is not analytic."""
    return np.where(np.real(a) == np.real(b), np.nan, np.less(np.real(a), np.real(b)))


def both(a: Array, b: Array) -> Array:
    """Return a and b, of truth values 0 and 1."""
    return a * b


def either(a: Array, b: Array) -> Array:
    """Return a or b, of truth values 0 and 1."""
    return a + b - a * b


def opposite(a: Array) -> Array:
    """Return not a, of truth values 0 and 1."""
    return 1 - a


NUMPY: dict[str, Callable] = {
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "asinh": np.arcsinh,
    "acosh": np.arccosh,
    "atanh": np.arctanh,
    "erf": erf,
    "log1p": np.log1p,
    "expm1": np.expm1,
    "sqrt": np.sqrt,
    "atan2": atan2,
    "power": np.power,
    "lt": less,
    "le": less,
    "logic_and": both,
    "logic_or": either,
    "logic_not": opposite,
}
CASADI: dict[str, Callable] = {name: getattr(ca, name) for name in NUMPY}


BUILDING, MULTIPLYING = 1.5, 0.1
"""Nanoseconds an entry of T takes to be gathered, and a product with it."""
FEW = 3
"""Rows up to which a loop is faster than a sparse matrix."""
AT_ONCE = 200_000
"""Entries of products before summation that are held at once, so that they stay in the cache."""


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

    Parameters: a, b: rows with their degree in z. The one whose matrices T cost less gives them.
    """
    (A, m), (B, n) = a, b
    entries = [
        len(one) * tail.width(k) * (BUILDING + MULTIPLYING * len(other)) for one, other, k in ((A, B, n), (B, A, m))
    ]
    if entries[1] < entries[0]:
        (A, m), (B, n), places = (B, n), (A, m), places.T
    if m == 0:
        (A, m), (B, n), places = (B, n), (A, m), places.T
    if n == 0:
        for weight, where in zip(B[:, 0], places.T, strict=True) if len(B) <= FEW else []:
            into[where] += weight * A
        if len(B) > FEW:
            add_rows(into, places.ravel(), np.tile(B[:, 0], len(A)), A)
        return
    step = max(1, AT_ONCE // (len(B) * into.shape[1]))
    table = differences(tail, n, m)
    for first in range(0, len(A), step):
        rows = A[first : first + step]
        padded = np.concatenate([rows, np.zeros((len(rows), 1), dtype=rows.dtype)], axis=1)
        products = np.matmul(B, np.take(padded, table, axis=1, mode="clip")).reshape(-1, into.shape[1])
        where = places[first : first + step].ravel()
        if len(rows) == 1 or len(B) == 1:
            into[where] += products
        else:
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


class Numeric:
    """Series with numbers as coefficients, at one point or at many (trailing axes)."""

    def __init__(self, indices: Indices, batch: tuple[int, ...] = (), dtype: type = float):
        self.indices, self.batch, self.dtype = indices, batch, dtype

    def zero(self) -> Array:
        """Return the series 0."""
        return np.zeros((self.indices.size, *self.batch), dtype=self.dtype)

    def convolve(self, a: Coefficients, b: Coefficients, k: int) -> Array:
        """Return the part of degree k of a product."""
        if self.indices.tabulated or self.batch:
            pairs, a, b = self.indices.pairs(k), whole(a), whole(b)
            return np.add.reduceat(a[pairs.left] * b[pairs.right], pairs.start, axis=0)
        return self.sum_products(a, b, k, np.ones(k + 1))

    def integrate(self, u: Coefficients, g: Coefficients, k: int) -> Array:
        """Return the part of degree k of y with y' = g u', by the Euler derivative: k y_k = sum_j j u_j g_(k-j)."""
        if self.indices.tabulated or self.batch:
            degrees = self.indices.degrees.reshape(-1, *[1] * len(self.batch))
            return self.convolve(degrees * whole(u), g, k) / k
        return self.sum_products(u, g, k, np.arange(k + 1) / k)

    def sum_products(self, a: Coefficients, b: Coefficients, k: int, weights: Array) -> Array:
        """Return sum_i weights_i a_i b_(k-i), leaving out parts that are zero."""
        total = self.zero()[self.indices.degree(k)]
        for i in range(max(0, k - reach(b)), min(k, reach(a)) + 1):
            left, right = a[self.indices.degree(i)], b[self.indices.degree(k - i)]
            if weights[i] and left.any() and right.any():
                total += multiply_parts(self.indices, weights[i] * left, i, right, k - i)
        return total

    def apply(self, name: str, *arguments: Array) -> Array:
        """Apply an elementary function elementwise."""
        return NUMPY[name](*arguments)

    def clean(self, part: Array) -> Array:
        """Return a part as it is kept."""
        return part

    def solve(self, V: Array, right: Array) -> Array:
        """Solve V x = right; V (m, m, ...), right (m, size, ...)."""
        inside = np.linalg.solve(np.moveaxis(V, (0, 1), (-2, -1)), np.moveaxis(right, (0, 1), (-2, -1)))
        return np.moveaxis(inside, (-2, -1), (0, 1))


class Symbolic:
    """Series with CasADi scalars as coefficients; a structural zero is the integer 0 and costs no instruction.

    Parameters: pivots: the order of rows for Gauss elimination of V, chosen from numbers near by.
    """

    dtype = object

    def __init__(self, indices: Indices, pivots: Array | None = None):
        self.indices, self.pivots = indices, pivots
        self.multiples: dict[tuple[int, int, int], tuple[ca.SX, ca.SX]] = {}

    def zero(self) -> Array:
        """Return the series 0."""
        return np.zeros(self.indices.size, dtype=object)

    def convolve(self, a: Array, b: Array, k: int) -> Array:
        """Return the part of degree k of a product, over the pairs of nonzeros only, those of a square once."""
        group, left, right = self.occupied_pairs(a, b, k)
        part = self.zero()[self.indices.degree(k)]
        for g, i, j in zip(group, left, right, strict=True):
            if a is not b or i <= j:
                term = a[i] * b[j]
                add_to(part, g, 2 * term if a is b and i != j else term)
        return part

    def integrate(self, u: Array, g: Array, k: int) -> Array:
        """Return the part of degree k of y with y' = g u', each coefficient by its cheapest partial derivative.

        alpha_i y_alpha = sum_beta beta_i u_beta g_(alpha - beta),   i: the least exponent alpha_i > 0
        """
        alpha = self.indices.powers[self.indices.degree(k)]
        cheapest = np.where(alpha > 0, alpha, k + 1).argmin(axis=1)
        part = self.zero()[self.indices.degree(k)]
        for result, i, j in zip(*self.occupied_pairs(u, g, k), strict=True):
            times = int(self.indices.powers[i, cheapest[result]])
            if times:
                add_to(part, result, self.multiple(u, i, times) * g[j])
        divisors = alpha[np.arange(len(alpha)), cheapest]
        return np.array([y if d == 1 else y / int(d) for y, d in zip(part, divisors, strict=True)] + [None])[:-1]

    def occupied_pairs(self, a: Array, b: Array, k: int) -> tuple[Array, Array, Array]:
        """Return result (counted within its degree), left and right place of the products of nonzeros that make degree k."""
        pairs = self.indices.pairs(k)
        present = np.flatnonzero(occupied(a)[pairs.left] & occupied(b)[pairs.right])
        group = np.searchsorted(pairs.start, present, side="right") - 1
        return group, pairs.left[present], pairs.right[present]

    def multiple(self, u: Array, i: int, times: int) -> ca.SX:
        """Return a whole multiple of a coefficient, made once for as long as the coefficient stays the same.

        Implicit series correct the part of degree k after it was first read: a multiple of the old coefficient is stale.
        """
        if times == 1:
            return u[i]
        key = (id(u), int(i), times)
        if key not in self.multiples or self.multiples[key][0] is not u[i]:
            self.multiples[key] = (u[i], times * u[i])
        return self.multiples[key][1]

    def apply(self, name: str, *arguments: Array) -> Array:
        """Apply an elementary function elementwise."""
        result = np.zeros(len(arguments[0]), dtype=object)
        for i, values in enumerate(zip(*arguments, strict=True)):
            result[i] = CASADI[name](*[ca.SX(value) for value in values])
        return result

    def clean(self, part: Array) -> Array:
        """Return a part with its zeros made structural."""
        for i, value in enumerate(part):
            if value.is_zero() if isinstance(value, ca.SX) else value == 0:
                part[i] = 0
        return part

    def solve(self, V: Array, right: Array) -> Array:
        """Solve V x = right by Gauss elimination in the chosen order of rows; V (m, m), right (m, size)."""
        A, x = V[self.pivots].copy(), right[self.pivots].copy()
        m = len(A)
        for j in range(m):
            for i in range(j + 1, m):
                if occupied(A[i, j : j + 1])[0]:
                    factor = A[i, j] / A[j, j]
                    A[i, j + 1 :] = self.clean(A[i, j + 1 :] - scaled(factor, A[j, j + 1 :]))
                    x[i] = self.clean(x[i] - scaled(factor, x[j]))
        for i in reversed(range(m)):
            for j in range(i + 1, m):
                x[i] = self.clean(x[i] - scaled(A[i, j], x[j]))
            x[i] = scaled(1 / A[i, i], x[i])
        return x


def occupied(part: Array) -> Array:
    """Return which coefficients are not structural zeros."""
    return np.array([type(value) is not int or value != 0 for value in part], dtype=bool)


def add_to(part: Array, place: int, term: ca.SX) -> None:
    """Add a term to a coefficient; to a structural zero without an operation."""
    part[place] = term if type(part[place]) is int else part[place] + term


def choose(switch: Array, part: Array) -> Array:
    """Return a part where the switch (of length 1) is on, else 0, whatever the part holds; nan where the switch is undecided."""
    if part.dtype != object:
        return np.where(switch == 0, 0.0, switch * part)
    chosen = np.zeros(len(part), dtype=object)
    for i in np.flatnonzero(occupied(part)):
        chosen[i] = ca.if_else(switch[0], part[i], 0)
    return chosen


def scaled(factor: ca.SX, part: Array) -> Array:
    """Multiply a part by a scalar, leaving structural zeros alone."""
    result = np.zeros(len(part), dtype=object)
    for i in np.flatnonzero(occupied(part)):
        result[i] = factor * part[i]
    return result
