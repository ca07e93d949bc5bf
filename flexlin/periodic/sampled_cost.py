"""The cost of a held input, exact from sample to sample, and the periodic Riccati equation of the sampled problem by doubling."""

from dataclasses import dataclass
from functools import reduce

import numpy as np

from flexlin.checks import Array
from flexlin.errors import IllPosedSegment, NotDetectable, NotStabilizable, NumericalError
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficients import Combined, assemble_hamiltonian, hold_input
from flexlin.periodic.related import beside
from flexlin.periodic.riccati.scattering import (
    MAX_DOUBLINGS,
    Segment,
    carry_costs_down,
    combine_in_tree,
    scatter_hamiltonian,
    star_product,
    transpose,
)
from flexlin.periodic.sampled import divide, step_inputs, step_sections
from flexlin.periodic.system import PeriodicSystem
from flexlin.precision import EPS, MINOR, ROOT_EPS

LARGEST_COST = 1e13
"""A cost so many times its first one, or a memory that does not fade, says that a mode is not moved, or not seen."""


@dataclass(frozen=True, eq=False)
class SampledProblem:
    """Minimise the sum of z' Q z + 2 z' N u + u' R u along z_(k+1) = F z_k + G u_k: each (N, ., .), repeating after N samples.

    What an input that comes late costs until the next sample counts where it is chosen, so R > 0 whatever the delay: X is that of the
    stated cost less [0, 0; 0, late], late (N, m, m).
    """

    F: Array
    G: Array
    Q: Array
    N: Array
    R: Array
    late: Array


def weigh_held(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """The Hamiltonian [[A, 0], [-W, -A']] of the state with the input that is held, W = diag(Q, R)."""
    held, W = hold_input(A, B), beside(Q, R)
    return assemble_hamiltonian(held, np.zeros_like(W), W)


def excite(A: Array, W: Array) -> Array:
    """The Hamiltonian [[A, -W], [0, -A']], in scattering form the covariance that noise of intensity W adds up to."""
    return assemble_hamiltonian(A, W, np.zeros_like(A))


def weigh_samples(
    system: PeriodicSystem,
    Q: ResolvedMatrix,
    R: ResolvedMatrix,
    samples: int,
    periods: int,
    delay: float,
    tol: float,
    stages: int,
) -> SampledProblem:
    """The discrete-time problem over `samples` equal intervals of `periods` periods; delay as a part of one interval, in [0, 1].

        [x; u](t) = P(t) [x; u](t0),   S = integral of P' diag(Q, R) P dt

    of the section before the input changes, with the input held before, and of the section behind it.
    Source: Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat. Control 23 (1978) 395.
    """
    n, m = system.n, system.m
    span = system.period * periods
    t, h = span * np.arange(samples) / samples, span / samples
    weighed = Combined(weigh_held, (system.resolved, system.resolved_input, Q, R))

    def section(begin: Array, end: Array) -> tuple[Array, Array]:
        if not np.any(end > begin):
            return np.broadcast_to(np.eye(n + m), (samples, n + m, n + m)), np.zeros((samples, n + m, n + m))
        whole = join_steps(step_sections(weighed, divide(system, begin, end, tol, (Q, R)), stages))
        return whole.F, whole.H

    (P0, S0), (P1, S1) = section(t, t + delay * h), section(t + delay * h, t + h)
    F, G = step_inputs(P0, P1, n, delay)
    if not delay:
        return SampledProblem(F, G, S1[:, :n, :n], S1[:, :n, n:], S1[:, n:, n:], np.zeros((samples, m, m)))
    late = integrate_weight(R, divide(system, t, t + delay * h, tol, (Q, R)))
    through = np.zeros((samples, n + m, n + 2 * m))
    through[:, :n, : n + m], through[:, n:, n + m :] = P0[:, :n], np.eye(m)
    whole = transpose(through) @ S1 @ through
    whole[:, : n + m, : n + m] += S0
    whole[:, n : n + m, n : n + m] -= late
    whole[:, n + m :, n + m :] += np.roll(late, -1, axis=0)
    r = n + m
    return SampledProblem(F, G, whole[:, :r, :r], whole[:, :r, r:], whole[:, r:, r:], late)


def join_steps(steps: Array) -> Segment:
    """Sections (N, s, s) of all their steps (N, c, 2 s, 2 s) by transition matrices of a Hamiltonian."""
    parts = scatter_hamiltonian(steps)
    return reduce(star_product, (parts[:, k] for k in range(steps.shape[1])))


def integrate_weight(R: ResolvedMatrix, edges: Array) -> Array:
    """The integral of R (N, m, m) over all steps between edges (N, c + 1), by Gauss's rule."""
    x, w = np.polynomial.legendre.leggauss(8)
    h = np.diff(edges, axis=1)[:, :, None]
    t = edges[:, :-1, None] + h * (x + 1) / 2
    values = R(np.mod(t, R.period).ravel()).reshape(*t.shape, *R.shape)
    return np.einsum("kcs,kcsij->kij", h * w / 2, values)


def spread_noise(
    system: PeriodicSystem, W: ResolvedMatrix, samples: int, periods: int, tol: float, stages: int
) -> tuple[Array, Array]:
    """F and the integral of P W P' dt (N, n, n) over equal intervals, P the transition matrix to their ends."""
    span = system.period * periods
    t, h = span * np.arange(samples) / samples, span / samples
    steps = step_sections(Combined(excite, (system.resolved, W)), divide(system, t, t + h, tol, (W,)), stages)
    whole = join_steps(steps)
    return whole.F, whole.G


def solve_samples(problem: SampledProblem) -> tuple[Array, Array]:
    """X (N, r, r) and K (N, m, r) of the stabilising solution, u_k = -K_k z_k.

        X_k = Q + F' X_(k+1) F - (F' X_(k+1) G + N) (R + G' X_(k+1) G)^-1 (G' X_(k+1) F + N'),   X_(k+N) = X_k

    Each sample in scattering form without its cross term, a tree of star products over the round, then the round doubled. The cost of
    the gains themselves gives back the digits that growth within a round takes: a tenth of the error is left.
    Raises: NotStabilizable, NotDetectable where doubling does not settle; NumericalError where growth within a sample leaves no digits.
    Source: Anderson, Int. J. Control 28 (1978) 295; Hewer, IEEE Trans. Automat. Control 16 (1971) 382; Bittanti, Colaneri, Periodic
    Systems (2009), ch. 6.
    """
    try:
        by_effort = np.linalg.solve(problem.R, np.concatenate([transpose(problem.G), transpose(problem.N)], axis=2))
        to_input, cross = np.split(by_effort, 2, axis=2)
        steps = Segment(problem.F - problem.G @ cross, problem.G @ to_input, problem.Q - problem.N @ cross)
        X = cost_gains(problem, gain_samples(problem, repeat_round(steps)))
        return X, gain_samples(problem, X)
    except (np.linalg.LinAlgError, IllPosedSegment, NotStabilizable) as reason:
        grown = float(np.abs(problem.F).max())
        if not isinstance(reason, np.linalg.LinAlgError) and grown * ROOT_EPS < MINOR:
            raise
        raise NumericalError(
            "the gains are lost to rounding", got=f"growth by {grown:.1g} within a sample", todo="sample faster"
        ) from None


def cost_gains(problem: SampledProblem, K: Array) -> Array:
    """The cost X (N, r, r) of gains that stabilise: X_k = (F - G K)' X_(k+1) (F - G K) + Q - N K - K' N' + K' R K."""
    loop, crossed = problem.F - problem.G @ K, problem.N @ K
    cost = problem.Q - crossed - transpose(crossed) + transpose(K) @ problem.R @ K
    return repeat_round(Segment(loop, np.zeros_like(loop), cost))


def gain_samples(problem: SampledProblem, X: Array) -> Array:
    """K_k = (R + G' X_(k+1) G)^-1 (G' X_(k+1) F + N')."""
    pushed = transpose(problem.G) @ np.roll(X, -1, axis=0)
    return np.linalg.solve(problem.R + pushed @ problem.G, pushed @ problem.F + transpose(problem.N))


def repeat_round(steps: Segment) -> Array:
    """The cost (N, r, r) at the beginning of each of the steps of a round that repeats for ever."""
    levels = combine_in_tree(steps)
    return carry_costs_down(levels, double_round(levels[-1][0]))[:-1]


def double_round(whole: Segment) -> Array:
    """H of 2^k rounds, which stops changing, while their memory F fades."""
    first = max(float(np.abs(whole.H).max()), float(np.abs(whole.G).max()), EPS)
    for _ in range(MAX_DOUBLINGS):
        with np.errstate(over="ignore", invalid="ignore"):
            twice = star_product(whole, whole)
        sizes = [float(np.abs(part).max()) for part in (twice.H, twice.G)]
        if not sizes[0] < LARGEST_COST * first:
            raise NotStabilizable(
                "a mode that does not decay cannot be reached by the held input",
                got=f"a cost of {sizes[0]:.2g}",
                todo="add an actuator that moves it, or take another sampling time: some hide a mode from the samples",
            )
        change = float(np.abs(twice.H - whole.H).max())
        if change <= EPS * sizes[0] and np.abs(twice.F).max() <= np.sqrt(EPS):
            return twice.H
        if not sizes[1] < LARGEST_COST * first:
            break
        whole = twice
    raise NotDetectable(
        "a mode that does not decay is not seen by the weight Q at the samples",
        got=f"a memory of {float(np.abs(whole.F).max()):.2g} over the longest span",
        todo="give the mode's states weight in Q",
    )


def bound_rounding(problem: SampledProblem, X: Array, K: Array) -> float:
    """What rounding of one step of the equation and its matrices, carried along the loop, makes of X, relative to its largest entry."""
    loop = problem.F - problem.G @ K
    size = float(np.abs(X).max()) or 1.0
    weight = np.broadcast_to(np.eye(loop.shape[1]), loop.shape) * 8 * EPS * len(loop[0]) * size
    return float(np.abs(repeat_round(Segment(loop, np.zeros_like(loop), weight))).max()) / size
