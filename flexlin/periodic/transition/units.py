"""Units in which the rows and columns of A(t) are of like size: what a solution of linear equations needs to keep its digits."""

from collections.abc import Callable

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import LAPACK
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.system import PeriodicSystem

SEEN = 97
"""Times at which the sizes of A's entries are looked at."""
FAR = 2.0**10
"""Units that differ by less are left as they are."""


def find_like_units(system: PeriodicSystem) -> Array:
    """Powers of two (n,) by which rows of A are divided and columns multiplied, so that rows and columns are alike in size.

    Source: Parlett, Reinsch, Balancing a matrix, Numer. Math. 13 (1969), on the sum of |A(t)|.
    """
    size = np.abs(system.resolved(system.period * np.arange(SEEN) / SEEN)).sum(axis=0)
    return np.asarray(LAPACK.dgebal(size, scale=1, permute=0)[3])


def factor_in_like_units(system: PeriodicSystem, factor: Callable[[MatrixFunction], Array]) -> Array:
    """Transition matrices (K, n, n) from A(t) in like units, in those of A again: powers of two change no digit of either."""
    scale = find_like_units(system)
    if scale.max() < FAR * scale.min():
        return factor(system.resolved)
    turn = scale / scale[:, None]
    return factor(lambda t: system.resolved(t) * turn) / turn
