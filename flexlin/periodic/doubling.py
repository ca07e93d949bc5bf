"""The stabilising solution at the edges of a period: products in a tree, the period doubled until its cost rests."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.blocked import blocked_mode, sizes_without_coupling
from flexlin.periodic.linear_quadratic import LinearQuadratic
from flexlin.periodic.scattering import Segment, costs_at_edges, product_tree, star_product

MAX_DOUBLINGS = 64
ROUNDING = 64 * np.finfo(float).eps
"""Relative error that rounding makes in one period: a few units for each of the operations that touch an entry."""


@dataclass(frozen=True)
class EdgeCosts:
    """X at all marks (K + 1, n, n), how well the period closes, the doublings it took, and the relative error by rounding."""

    X: Array
    closure: float
    doublings: int
    rounding: float


def costs_to_go(segments: Segment, end: Array | None, problem: LinearQuadratic, marks: Array) -> EdgeCosts:
    """Carry the cost at the end, or the periodic one when end is None, to all marks.

    A rounding error made once in every period adds up over the periods that the closed loop remembers.
    """
    levels = product_tree(segments)
    if end is not None:
        return EdgeCosts(costs_at_edges(levels, end), 0.0, 0, ROUNDING)
    last, doublings, memory = doubled(segments, levels[-1][0], problem, marks)
    X = costs_at_edges(levels, last)
    return EdgeCosts(X, float(np.abs(X[0] - last).max() / (np.abs(X).max() or 1.0)), doublings, ROUNDING * memory)


def doubled(segments: Segment, period: Segment, problem: LinearQuadratic, marks: Array) -> tuple[Array, int, float]:
    """Double one period until the cost H of 2^k periods stops changing and the loop's memory F is gone.

    Returns: H, the number of doublings, and the norm of the sum of (F^k)' F^k over all periods: the loop's memory.
    Raises: NotStabilizable when H grows for ever; NotDetectable when G does, or F does not decay.
    """
    limits = sizes_without_coupling(problem, float(marks[-1]))
    whole, scale, memory = period, max(float(np.abs(period.F).max()), 1.0), np.eye(len(period.F))
    for k in range(MAX_DOUBLINGS):
        with np.errstate(over="ignore", invalid="ignore"):
            twice = star_product(whole, whole)
        if not np.abs(twice.H).max() < limits[0]:
            raise blocked_mode(True, segments, whole, 1e-6 * limits[0], problem, marks)
        if not np.abs(twice.G).max() < limits[1]:
            break
        memory = memory + whole.F.T @ memory @ whole.F
        before, whole = whole, twice
        rests = np.abs(whole.H - before.H).max() <= 1e-16 * np.abs(whole.H).max()
        if rests and np.abs(whole.F).max() <= 1e-8 * scale:
            return whole.H, k + 1, float(np.linalg.norm(memory, 2))
    raise blocked_mode(False, segments, whole, 1e-6 * limits[1], problem, marks)
