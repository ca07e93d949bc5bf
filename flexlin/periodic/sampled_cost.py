"""The cost of a held input, exact from sample to sample, and the periodic Riccati equation of the sampled problem by doubling."""

from dataclasses import dataclass
from functools import reduce

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficients import Combined, MatrixFunction, assemble_hamiltonian, hold_input
from flexlin.periodic.related import beside
from flexlin.periodic.riccati.linear_quadratic import refuse_mode
from flexlin.periodic.riccati.scattering import (
    balance_states,
    carry_costs_down,
    double_until_rest,
    grow_tree,
    scatter_hamiltonian,
    star_product,
    transpose,
    twice,
)
from flexlin.periodic.sampled import Round, divide_sections, step_inputs
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.factors import gauss_transitions
from flexlin.periodic.transition.gauss import DEFAULT_STAGES, gauss, place_nodes, sample_at
from flexlin.precision import EPS, FAINT, MINOR, ROOT_EPS, SAFETY

LARGEST_COST = 1e13
"""A cost so many times what a sample's growth, input and weight make, or a memory that does not fade, says that a mode is not moved, or
not seen."""


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

    def reduced(self) -> tuple[Array, Array, Array]:
        """F - G R^-1 N', G R^-1 G' and Q - N R^-1 N': the problem without its cross term."""
        by_effort = np.linalg.solve(self.R, np.concatenate([transpose(self.G), transpose(self.N)], axis=2))
        to_input, cross = np.split(by_effort, 2, axis=2)
        return self.F - self.G @ cross, self.G @ to_input, self.Q - self.N @ cross

    def express(self, states: Array, inputs: Array) -> "SampledProblem":
        """The problem of states * z and inputs * u."""
        F, G, Q = (
            self.F * (states[:, None] / states),
            self.G * (states[:, None] / inputs),
            self.Q / np.outer(states, states),
        )
        both = np.outer(inputs, inputs)
        return SampledProblem(F, G, Q, self.N / np.outer(states, inputs), self.R / both, self.late / both)


def weigh_held(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """The Hamiltonian [[A, 0], [-W, -A']] of the state with the input that is held, W = diag(Q, R)."""
    held, W = hold_input(A, B), beside(Q, R)
    return assemble_hamiltonian(held, np.zeros_like(W), W)


def weigh_samples(
    system: PeriodicSystem,
    Q: ResolvedMatrix,
    R: ResolvedMatrix,
    turn: Round,
    delay: float,
    tol: float,
    stages: int,
) -> SampledProblem:
    """The discrete-time problem over the samples of a round; delay as a part of one, in [0, 1].

        [x; u](t) = P(t) [x; u](t0),   S = integral of P' diag(Q, R) P dt

    of the section before the input changes, with the input held before, and of the section behind it.
    Source: Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automat. Control 23 (1978) 395.
    """
    n, m, samples = system.n, system.m, turn.samples
    r, (begin, effect, end) = n + m, turn.divide(delay)
    weighed = Combined(weigh_held, (system.resolved, system.resolved_input, Q, R))
    P1, _, S1 = join_steps(weighed, divide_sections(system, effect, end, tol, (Q, R)), stages)
    if not delay:
        nothing = np.zeros((samples, m, m))
        return SampledProblem(*step_inputs(None, P1, n), S1[:, :n, :n], S1[:, :n, n:], S1[:, n:, n:], nothing)
    edges = divide_sections(system, begin, effect, tol, (Q, R))
    P0, _, S0 = join_steps(weighed, edges, stages)
    rule, h = gauss(DEFAULT_STAGES), np.diff(edges)
    late = np.einsum("kc,s,kcsij->kij", h, rule.b, sample_at(R, place_nodes(edges, rule.c)))
    through = np.zeros((samples, r, r + m))
    through[:, :n, :r], through[:, n:, r:] = P0[:, :n], np.eye(m)
    whole = transpose(through) @ S1 @ through
    whole[:, :r, :r] += S0
    whole[:, n:r, n:r] -= late
    whole[:, r:, r:] += np.roll(late, -1, axis=0)
    return SampledProblem(*step_inputs(P0, P1, n), whole[:, :r, :r], whole[:, :r, r:], whole[:, r:, r:], late)


def join_steps(A: MatrixFunction, edges: Array, stages: int) -> Array:
    """Segments of the sections between edges (N, c + 1), whose Hamiltonian is A."""
    parts = scatter_hamiltonian(gauss_transitions(A, edges, stages))
    return reduce(star_product, np.moveaxis(parts, 2, 0))


def spread_noise(
    system: PeriodicSystem, W: ResolvedMatrix, turn: Round, tol: float, stages: int
) -> tuple[Array, Array]:
    """F and the integral of P W P' dt (N, n, n) over the samples of a round, P the transition matrix to their ends."""
    edges = divide_sections(system, *turn.divide(0.0)[1:], tol, (W,))
    excited = Combined(lambda A, W: assemble_hamiltonian(A, W, np.zeros_like(A)), (system.resolved, W))
    F, added, _ = join_steps(excited, edges, stages)
    return F, added


def solve_balanced(problem: SampledProblem, better: SampledProblem) -> tuple[Array, Array, float]:
    """X, K, and the error of K relative to its largest entry: what a better problem changes, and rounding.

    Raises: as `solve_samples`; NotStabilizable where no digit of K is known.
    """
    inputs = 2.0 ** np.round(np.log2(np.diagonal(problem.R, axis1=1, axis2=2).max(axis=0)) / 2)
    states = balance_states(*problem.express(np.ones(problem.F.shape[1]), inputs).reduced())
    problem, better = (one.express(states, inputs) for one in (problem, better))
    (X, K), (_, other) = solve_samples(problem), solve_samples(better)
    doubt = SAFETY * np.abs(other - K) + bound_rounding(problem, X, K)
    K, doubt = (one * (states / inputs[:, None]) for one in (K, doubt))
    error = float(doubt.max() / (np.abs(K).max() or 1.0))
    if error >= 1:
        raise refuse_at_samples(True, f"an error of {error:.1g} of the gains")
    return X * np.outer(states, states), K, error


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
        X = repeat_round(*problem.reduced())
        X = cost_gains(problem, gain_samples(problem, X))
        return X, gain_samples(problem, X)
    except (np.linalg.LinAlgError, NumericalError) as reason:
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
    return repeat_round(loop, np.zeros_like(loop), cost)


def gain_samples(problem: SampledProblem, X: Array) -> Array:
    """K_k = (R + G' X_(k+1) G)^-1 (G' X_(k+1) F + N')."""
    pushed = transpose(problem.G) @ np.roll(X, -1, axis=0)
    return np.linalg.solve(problem.R + pushed @ problem.G, pushed @ problem.F + transpose(problem.N))


def repeat_round(F: Array, G: Array, H: Array) -> Array:
    """The cost (N, r, r) at the beginning of each of the steps of a round that repeats for ever."""
    levels = grow_tree(np.stack([F, G, H]), star_product)
    growth, moved, cost = np.maximum(np.abs(levels[0]).max(axis=(1, 2, 3)), [1.0, 1e-100, 1e-100])
    most = LARGEST_COST * max(growth**2 / moved, cost), LARGEST_COST * max(growth**2 / cost, moved)
    return carry_costs_down(levels, double_until_rest(levels[-1][:, 0], most, name_cause)[0])[:-1]


def name_cause(unreached: bool, whole: Array) -> NumericalError:
    """Why rounds that are doubled, at last a segment (3, r, r), do not rest."""
    F, _, H = np.abs(whole).max(axis=(1, 2))
    return refuse_at_samples(
        unreached, f"a cost of {H:.2g}" if unreached else f"a memory of {F:.2g} over the longest span"
    )


def refuse_at_samples(unreached: bool, got: str) -> NumericalError:
    """The error of a mode that the samples do not move, or do not see."""
    else_do = ", or take another sampling time: some hide a mode from the samples"
    return refuse_mode(unreached, got, " at the samples, or too weakly to be computed with", else_do)


def bound_rounding(problem: SampledProblem, X: Array, K: Array) -> Array:
    """What rounding of the terms of X, carried along the loop, and of K's own makes of the gains: (N, m, r).

    -W <= E_k <= W,   D = L' D L + W,   |dK_ij| <= sqrt((T D T')_ii (L' D L)_jj),   L = F - G K,   T = (R + G' X G)^-1 G'
    """
    loop, size, ahead = (
        problem.F - problem.G @ K,
        [np.abs(one) for one in (problem.F, problem.G, K)],
        np.roll(X, -1, axis=0),
    )
    F, G, gain = size
    terms = transpose(np.abs(loop)) @ np.abs(ahead) @ (F + G @ gain) + np.abs(problem.N) @ gain
    terms += (np.abs(problem.Q) + transpose(gain) @ np.abs(problem.R) @ gain) / 2
    lost = SAFETY * EPS * loop.shape[1] * twice(terms)
    units = np.sqrt(np.diagonal(lost, axis1=1, axis2=2).max(axis=0))
    units = np.maximum(units, FAINT * units.max() or 1.0)
    W = (lost / units).sum(axis=2) * units
    D = repeat_round(loop, np.zeros_like(loop), W[:, :, None] * np.eye(len(units)))
    D = np.roll(D, -1, axis=0)
    to_input = np.linalg.solve(problem.R + transpose(problem.G) @ ahead @ problem.G, transpose(problem.G))
    reached, carried = ((one @ D * one).sum(axis=2) for one in (to_input, transpose(loop)))
    own = SAFETY * EPS * loop.shape[1] * (np.abs(to_input) @ np.abs(ahead) @ F + gain)
    return np.asarray(np.sqrt(reached[:, :, None] * carried[:, None]) + own)
