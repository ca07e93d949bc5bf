"""Segments of a period: edges that respect the breaks of the coefficients."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError


def place_edges(period: float, breaks: Sequence[float], segments: int) -> Array:
    """Divide [0, T] into about `segments` intervals of equal length, none of which holds a break inside.

    Every piece between neighbouring breaks gets ceil(segments * length / T) segments, so at least one.

    Parameters: period in s; breaks: times in [0, T); segments: the wished number.
    Returns: increasing times (K + 1,) from 0 to T, K >= segments.
    Raises: ArgumentError when segments is not at least 1.
    """
    if segments < 1:
        raise ArgumentError("no segments", got=segments, expected="at least 1")
    corners = np.unique([0.0, *breaks, period])
    pieces = [
        np.linspace(a, b, math.ceil(segments * (b - a) / period * (1 - 1e-12)) + 1)[:-1] for a, b in pairwise(corners)
    ]
    return np.concatenate([*pieces, [period]])
