"""The stabilising solution at the edges of a period: products in a tree, the period doubled until its cost rests."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotDetectable, NotStabilizable
from flexlin.periodic.quadratic.blocked import bound_sizes, name_blocked_mode
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.scattering import Segment, carry_costs_down, combine_in_tree, star_product

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


def carry_costs(
    segments: Segment, end: Array | None, problem: LinearQuadratic, marks: Array, named: bool = True
) -> EdgeCosts:
    """Carry the cost at the end, or the periodic one when end is None, to all marks.

    A rounding error made once in every period adds up over the periods that the closed loop remembers.
    """
    levels = combine_in_tree(segments)
    if end is not None:
        return EdgeCosts(carry_costs_down(levels, end), 0.0, 0, ROUNDING)
    last, doublings, memory = double_period(segments, levels[-1][0], problem, marks, named)
    X = carry_costs_down(levels, last)
    return EdgeCosts(X, float(np.abs(X[0] - last).max() / (np.abs(X).max() or 1.0)), doublings, ROUNDING * memory)


def double_period(
    segments: Segment, period: Segment, problem: LinearQuadratic, marks: Array, named: bool = True
) -> tuple[Array, int, float]:
    """Double one period until the cost H of 2^k periods stops changing and the loop's memory F is gone.

    Returns: H, the number of doublings, and the norm of the sum of (Phi^k)' H Phi^k over all periods relative to that of H:
    how far a relative error of H made in every period adds up.
    Raises: NotStabilizable when H grows for ever; NotDetectable when G does, or F does not decay; with the mode's name where that is
    asked for, which takes as long as the rest.
    """
    limits = bound_sizes(problem, float(marks[-1]))
    whole, scale = period, max(float(np.abs(period.F).max()), 1.0)
    for k in range(MAX_DOUBLINGS):
        with np.errstate(over="ignore", invalid="ignore"):
            twice = star_product(whole, whole)
        if not np.abs(twice.H).max() < limits[0]:
            if not named:
                raise NotStabilizable("the cost grows for ever")
            raise name_blocked_mode(True, segments, whole, 1e-6 * limits[0], problem, marks)
        if not np.abs(twice.G).max() < limits[1]:
            break
        before, whole = whole, twice
        rests = np.abs(whole.H - before.H).max() <= 1e-16 * np.abs(whole.H).max()
        if rests and np.abs(whole.F).max() <= 1e-8 * scale:
            return whole.H, k + 1, measure_memory(period, whole.H)
    if not named:
        raise NotDetectable("the loop does not forget")
    raise name_blocked_mode(False, segments, whole, 1e-6 * limits[1], problem, marks)


def measure_memory(period: Segment, X: Array) -> float:
    """Return |sum over k of (Phi^k)' X Phi^k| / |X| with the closed loop's period map Phi = (I + G X)^-1 F."""
    Phi, total = np.linalg.solve(np.eye(len(X)) + period.G @ X, period.F), X
    for _ in range(MAX_DOUBLINGS):
        total, Phi = total + Phi.T @ total @ Phi, Phi @ Phi
        if np.abs(Phi).max() < 1e-8:
            break
    return float(np.linalg.norm(total) / (np.linalg.norm(X) or 1.0))
