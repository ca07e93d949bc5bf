"""Transition matrices by Magnus series: exact where A is constant, so the fast modes of a stiff link cost nothing."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.system import MatrixFunction
from flexlin.periodic.transition.exponential import exponentiate
from flexlin.periodic.transition.gauss import gauss, place_nodes, sample_at

CHUNK_NODES_BYTES = 2**25
"""Samples of A in one batch take at most this many bytes."""


def magnus_transitions(A: MatrixFunction, edges: Array, order: int) -> Array:
    """Transition matrices of x' = A(t) x over the segments between consecutive edges, Phi = exp(Omega).

        order 4:  Omega = a1 + [b, a1'] from two Gauss nodes;   order 6: from three Gauss nodes, four commutators

    Assumes A smooth inside each segment. Phi stays in the Lie group of A (symplectic, orthogonal).

    Parameters: A: function (N,) -> (N, n, n); edges: increasing times (K + 1,); order: 4 or 6.
    Returns: Phi (K, n, n).
    Raises: ArgumentError for another order.
    Source: Blanes, Casas, Oteo, Ros, The Magnus expansion and some of its applications, Physics Reports 470 (2009), Eqs (253), (257).
    """
    if order not in (4, 6):
        raise ArgumentError("no Magnus method of this order", got=order, expected="4 or 6")
    c = gauss(order // 2).c
    t, h = place_nodes(edges, c), np.diff(edges)[:, None, None]
    omega = average_fourth if order == 4 else average_sixth
    n = A(t[0, :1]).shape[-1]
    size = max(1, CHUNK_NODES_BYTES // (8 * n * n * len(c)))
    parts = [
        exponentiate(omega(np.moveaxis(sample_at(A, t[k : k + size]), 1, 0), h[k : k + size]))
        for k in range(0, len(t), size)
    ]
    return np.concatenate(parts)


def average_fourth(A: Array, h: Array) -> Array:
    """Omega = h (A1 + A2) / 2 - sqrt(3) h^2 [A1, A2] / 12, from A (2, K, n, n) at the two Gauss nodes."""
    return h / 2 * (A[0] + A[1]) - np.sqrt(3) / 12 * h * h * commute(A[0], A[1])


def average_sixth(A: Array, h: Array) -> Array:
    """Omega with exp(Omega) = Phi + O(h^7), from A (3, K, n, n) at the three Gauss nodes and lengths h (K, 1, 1).

    a1 = h A2,   a2 = sqrt(15)/3 h (A3 - A1),   a3 = 10/3 h (A3 - 2 A2 + A1),   C1 = [a1, a2],   C2 = -[a1, 2 a3 + C1] / 60
    Omega = a1 + a3 / 12 + [-20 a1 - a3 + C1, a2 + C2] / 240
    """
    a1 = h * A[1]
    a2 = np.sqrt(15) / 3 * h * (A[2] - A[0])
    a3 = 10 / 3 * h * (A[2] - 2 * A[1] + A[0])
    C1 = commute(a1, a2)
    C2 = -commute(a1, 2 * a3 + C1) / 60
    return a1 + a3 / 12 + commute(-20 * a1 - a3 + C1, a2 + C2) / 240


def commute(X: Array, Y: Array) -> Array:
    """Return [X, Y] = X Y - Y X."""
    return X @ Y - Y @ X
