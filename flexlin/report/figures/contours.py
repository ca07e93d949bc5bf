"""Lines of equal height through a table of values, by linear interpolation on the edges of its cells."""

import numpy as np

from flexlin.checks import Array

EDGES = (((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (0, 1)), ((0, 1), (0, 0)))
"""The edges of a cell, corner to corner."""


def trace_contour(x: Array, y: Array, values: Array, level: float) -> tuple[Array, Array]:
    """The contour as coordinates (N,), its pieces parted by values that are not a number.

    A cell with four crossings joins neighbours on its rim. Source: Lorensen, Cline, Marching cubes (1987), in the plane.
    """
    above = values > level
    pieces: list[tuple[float, float]] = []
    mixed = above[:-1, :-1].astype(int) + above[1:, :-1] + above[:-1, 1:] + above[1:, 1:]
    finite = np.isfinite(values)
    whole = finite[:-1, :-1] & finite[1:, :-1] & finite[:-1, 1:] & finite[1:, 1:]
    for i, j in np.argwhere((mixed > 0) & (mixed < 4) & whole):
        ends = [end for edge in EDGES if (end := cross_edge(x, y, values, level, i, j, edge)) is not None]
        for first, second in zip(ends[::2], ends[1::2], strict=False):
            pieces += [first, second, (np.nan, np.nan)]
    points = np.array(pieces).reshape(-1, 2)
    return points[:, 0], points[:, 1]


def cross_edge(
    x: Array, y: Array, values: Array, level: float, i: int, j: int, edge: tuple[tuple[int, int], tuple[int, int]]
) -> tuple[float, float] | None:
    """Where one edge of a cell meets the level, if it does."""
    (a, b), (c, d) = edge
    first, second = values[i + a, j + b], values[i + c, j + d]
    if (first > level) == (second > level):
        return None
    share = (level - first) / (second - first)
    return (
        float(x[i + a] + share * (x[i + c] - x[i + a])),
        float(y[j + b] + share * (y[j + d] - y[j + b])),
    )
