"""The stabilising solution at the edges of a period: products in a tree, the period doubled until its cost rests."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import IllPosedSegment
from flexlin.periodic.quadratic.blocked import bound_sizes, name_blocked_mode
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.scattering import (
    MAX_DOUBLINGS,
    Segment,
    carry_costs_down,
    combine_in_tree,
    star_product,
)


def carry_costs(
    segments: Segment, end: Array | None, problem: LinearQuadratic, marks: Array, held: float = 1.0
) -> tuple[Array, int]:
    """Carry the cost at the end, or the periodic one when end is None, to all marks (K + 1, n, n); the doublings it took."""
    levels = combine_in_tree(segments)
    doublings = 0
    if end is None:
        end, doublings = double_period(segments, levels[-1][0], problem, marks, held)
    return carry_costs_down(levels, end), doublings


def double_period(
    segments: Segment, period: Segment, problem: LinearQuadratic, marks: Array, held: float = 1.0
) -> tuple[Array, int]:
    """Double one period until the cost H of 2^k periods stops changing and the loop's memory F is gone.

    held: part of the size that rounding might make of H or G from which on that is held to grow.
    Returns: H, the number of doublings.
    Raises: NotStabilizable when H grows for ever; NotDetectable when G does, or F does not decay; with the mode's name.
    """
    limits = [held * limit for limit in bound_sizes(problem, float(marks[-1]))]
    whole, scale = period, max(float(np.abs(period.F).max()), 1.0)
    for k in range(MAX_DOUBLINGS):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                twice = star_product(whole, whole)
        except IllPosedSegment:
            grows = bool(np.abs(whole.H).max() * limits[1] >= np.abs(whole.G).max() * limits[0])
            raise name_blocked_mode(grows, segments, whole, 1e-6 / held * limits[not grows], problem, marks) from None
        if not np.abs(twice.H).max() < limits[0]:
            raise name_blocked_mode(True, segments, whole, 1e-6 / held * limits[0], problem, marks)
        if not np.abs(twice.G).max() < limits[1]:
            break
        before, whole = whole, twice
        rests = np.abs(whole.H - before.H).max() <= 1e-16 * np.abs(whole.H).max()
        if rests and np.abs(whole.F).max() <= 1e-8 * scale:
            return whole.H, k + 1
    raise name_blocked_mode(False, segments, whole, 1e-6 / held * limits[1], problem, marks)
