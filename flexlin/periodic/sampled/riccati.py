"""The periodic Riccati equation of a sampled problem, by doubling of its rounds, and its error."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotDetectable, NotStabilizable
from flexlin.periodic.precision import EPS
from flexlin.periodic.quadratic.scattering import (
    MAX_DOUBLINGS,
    Segment,
    carry_costs_down,
    combine_in_tree,
    star_product,
    transpose,
)
from flexlin.periodic.sampled.cost import SampledProblem

LARGEST = 1e13
"""A cost so many times its first one, or a memory that does not fade, says that a mode is not moved, or not seen."""


def solve_samples(problem: SampledProblem) -> tuple[Array, Array]:
    """X (N, r, r) and K (N, m, r) of the stabilising solution, u_k = -K_k z_k.

        X_k = Q + F' X_(k+1) F - (F' X_(k+1) G + N) (R + G' X_(k+1) G)^-1 (G' X_(k+1) F + N'),   X_(k+N) = X_k

    Each sample in scattering form without its cross term, a tree of star products over the round, then the round doubled.
    Raises: NotStabilizable, NotDetectable where doubling does not settle.
    Source: Anderson, Int. J. Control 28 (1978) 295; Bittanti, Colaneri, Periodic Systems (2009), ch. 6.
    """
    by_effort = np.linalg.solve(problem.R, np.concatenate([transpose(problem.G), transpose(problem.N)], axis=2))
    r = problem.F.shape[1]
    to_input, cross = by_effort[:, :, :r], by_effort[:, :, r:]
    steps = Segment(problem.F - problem.G @ cross, problem.G @ to_input, problem.Q - problem.N @ cross)
    levels = combine_in_tree(steps)
    X = carry_costs_down(levels, double_round(levels[-1][0]))[:-1]
    return X, gain_samples(problem, X)


def gain_samples(problem: SampledProblem, X: Array) -> Array:
    """K_k = (R + G' X_(k+1) G)^-1 (G' X_(k+1) F + N')."""
    pushed = transpose(problem.G) @ np.roll(X, -1, axis=0)
    return np.linalg.solve(problem.R + pushed @ problem.G, pushed @ problem.F + transpose(problem.N))


def double_round(whole: Segment) -> Array:
    """H of 2^k rounds, which stops changing, while their memory F fades."""
    first = max(float(np.abs(whole.H).max()), float(np.abs(whole.G).max()), EPS)
    for _ in range(MAX_DOUBLINGS):
        with np.errstate(over="ignore", invalid="ignore"):
            twice = star_product(whole, whole)
        sizes = [float(np.abs(part).max()) for part in (twice.H, twice.G)]
        if not sizes[0] < LARGEST * first:
            raise NotStabilizable(
                "a mode that does not decay cannot be reached by the held input",
                got=f"a cost of {sizes[0]:.2g}",
                todo="add an actuator that moves it, or take another sampling time: some hide a mode from the samples",
            )
        change = float(np.abs(twice.H - whole.H).max())
        if change <= EPS * sizes[0] and np.abs(twice.F).max() <= np.sqrt(EPS):
            return twice.H
        if not sizes[1] < LARGEST * first:
            break
        whole = twice
    raise NotDetectable(
        "a mode that does not decay is not seen by the weight Q at the samples",
        got=f"a memory of {float(np.abs(whole.F).max()):.2g} over the longest span",
        todo="give the mode's states weight in Q",
    )


def bound_rounding(problem: SampledProblem, X: Array, K: Array) -> float:
    """What the rounding of one step of the equation, carried along the loop, makes of X, relative to its largest entry."""
    loop = problem.F - problem.G @ K
    size = float(np.abs(X).max()) or 1.0
    weight = np.broadcast_to(np.eye(loop.shape[1]), loop.shape) * EPS * len(loop[0]) * size
    levels = combine_in_tree(Segment(loop, np.zeros_like(loop), weight))
    return float(np.abs(carry_costs_down(levels, double_round(levels[-1][0]))).max()) / size
