"""Times of a period: edges of segments that respect the breaks of the coefficients, and what counts as narrow."""

from collections.abc import Sequence

import numpy as np

from flexlin.checks import Array, whole

FINER = (1.3, 4.0)
"""Bounds on how much finer the next resolution is: one that rounds independently, and one that is not far too fine."""
NAMED = 200
"""With `complete`, what is narrower than T / NAMED is named."""


def golden(i: Array) -> Array:
    """The golden sequence: no few of its numbers in (0, 1) lie close together."""
    return np.mod(i * (np.sqrt(5) - 1) / 2, 1.0)


def place_edges(period: float, breaks: Sequence[float] | Array, segments: int, least: int = 1) -> Array:
    """Divide [0, T] into about `segments` intervals of equal length, none of which holds a break inside.

    Every piece between neighbouring breaks gets ceil(segments * length / T) segments, and at least `least`.

    Parameters: period in s; breaks: times in [0, T); segments: the wished number.
    Returns: increasing times (K + 1,) from 0 to T, K >= segments.
    Raises: ArgumentError unless segments is a whole number from 1 on.
    """
    corners = np.unique([0.0, *breaks, period])
    grid = divided(corners, period / whole("segments", segments), least)
    return np.unique(grid)  # breaks one rounding apart leave no room for edges between them


def edges_of_short(edges: Array, longest: float) -> Array:
    """Return the edges of the panels that are shorter than `longest`: no step may pass over what a function does in one."""
    short = np.flatnonzero(np.diff(edges) < longest)
    return edges[np.union1d(short, short + 1)]


def divide_segments(grid: Array, parts: int) -> Array:
    """The grid with each segment divided into equal parts."""
    starts = grid[:-1, None] + np.diff(grid)[:, None] * (np.arange(parts) / parts)
    return np.append(starts, grid[-1])


def divided(edges: Array, longest: float, least: int = 1) -> Array:
    """Divide intervals evenly, each into so many at the least, until none is longer."""
    return divide_evenly(edges, np.maximum(least, np.ceil(np.diff(edges) / longest * (1 - 1e-12)).astype(int)))


def divide_evenly(edges: Array, counts: Array) -> Array:
    """Each interval between edges (K + 1,) divided into so many (K,)."""
    which = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(np.repeat(edges[:-1], counts) + np.repeat(np.diff(edges) / counts, counts) * which, edges[-1])
