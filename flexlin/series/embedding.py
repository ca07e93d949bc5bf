"""Series in some of the variables, read as series in more."""

from dataclasses import dataclass
from sys import maxsize

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
