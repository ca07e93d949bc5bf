"""The mean generator of a segment by Magnus' series: exact where A is constant."""

import numpy as np

from flexlin.checks import Array


def average_sixth(A: Array, h: Array) -> Array:
    """Omega with exp(Omega) = Phi + O(h^7), from A (3, K, n, n) at the three Gauss nodes and lengths h (K, 1, 1).

    a1 = h A2,   a2 = sqrt(15)/3 h (A3 - A1),   a3 = 10/3 h (A3 - 2 A2 + A1),   C1 = [a1, a2],   C2 = -[a1, 2 a3 + C1] / 60
    Omega = a1 + a3 / 12 + [-20 a1 - a3 + C1, a2 + C2] / 240

    Source: Blanes, Casas, Oteo, Ros, The Magnus expansion and some of its applications, Physics Reports 470 (2009), Eq. (257).
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
