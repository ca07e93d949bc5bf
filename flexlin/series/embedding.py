"""Series in some of the variables, read as series in more."""

from dataclasses import dataclass
from functools import lru_cache
from sys import maxsize

import numpy as np

from flexlin.checks import Array
from flexlin.series.indices import Indices, shared_indices


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
        k = int(np.searchsorted(self.indices.start, where.start or 0, side="right")) - 1 if where.start else 0
        part = np.zeros(self.indices.width(k), dtype=self.series.dtype)
        part[embed(self.among, self.indices.n, self.indices.order, k)] = self.series[self.own.degree(k)]
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


@lru_cache(maxsize=256)
def embed(among: tuple[int, ...], n: int, order: int, k: int) -> Array:
    """Return the places, within degree k in n variables, of the monomials of the variables `among`."""
    own, wider = shared_indices(len(among), order), shared_indices(n, order)
    powers = own.powers_of(k)
    spread = np.zeros((n, powers.shape[1]), dtype=powers.dtype)
    spread[list(among)] = powers
    return wider.rank(spread)
