"""Products of homogeneous parts of series in many variables: small matrices, and no list of index pairs is kept."""

import numpy as np

from flexlin.checks import Array
from flexlin.series.indices import Indices

BUILDING, MULTIPLYING = 1.5, 0.1
"""Nanoseconds an entry of T takes to be gathered, and a product with it."""
FEW = 3
"""Rows up to which a loop is faster than a sparse matrix."""
AT_ONCE = 200_000
"""Entries of products before summation that are held at once, so that they stay in the cache."""


def sum_products(indices: Indices, a: Array, b: Array, k: int, weights: Array) -> Array:
    """Return sum_i weights_i a_i b_(k-i) of two series, leaving out parts that are zero."""
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
