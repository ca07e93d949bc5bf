"""Riccati and Lyapunov equations of periodic systems and of finite horizons, on grids that step over no fast change."""

from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import NumericalError
from flexlin.periodic.coefficient_series.resolve import resolve
from flexlin.periodic.coefficients import Constant, MatrixFunction, assemble_hamiltonian, has_nothing_narrow, varies
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import need_stable
from flexlin.periodic.interpolation import FourierSeries, divided, edges_of_short
from flexlin.periodic.riccati.linear_quadratic import (
    PANEL_HARMONICS,
    WEIGHT_TIMES,
    LinearQuadratic,
    RiccatiSolution,
    check_between,
    check_weight,
    linear_quadratic,
)
from flexlin.periodic.riccati.newton import MOST_NODES, solve_by_newton
from flexlin.periodic.riccati.nodes import FourierNodes, Nodes, PanelNodes
from flexlin.periodic.system import PeriodicSystem, resolve_beside
from flexlin.periodic.transition.factors import Resolved
from flexlin.precision import MINOR

PER_WAVE = 4
"""Nodes for each wave of the coefficients on which X is sought first."""


@checked
def periodic_riccati(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> RiccatiSolution:
    """Find the stabilising periodic solution of the Riccati differential equation.

        -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q,   X(t + T) = X(t)

    Assumes (A, B) stabilisable, (Q, A) detectable, coefficients smooth between the system's breaks.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        Weight of the states, positive semidefinite.
    R : array_like (m, m), or function of times (N,) -> (N, m, m)
        Weight of the inputs, positive definite.
    N : array_like (n, m), or function of times (N,) -> (N, n, m), optional
        Weight of products of states and inputs.
    tol : float
        Wanted `error`, relative to max |X|.

    Returns
    -------
    RiccatiSolution
        X(t), K(t) with error, doublings, segments, status.

    Raises
    ------
    ArgumentError
        When a weight does not fit.
    NotStabilizable, NotDetectable
        When a mode that does not decay is not reached by the input, or not seen by the weight.
    IllPosedSegment
        When a segment has no solution.
    ToleranceNotReached
        When X misses tol by far.

    Notes
    -----
    Newton's method corrects X at equally spaced times, or on panels between jumps; exponentials of the loop solve its equations. It
    begins with segments on which the Hamiltonian is constant, in scattering form: they combine by the Redheffer star product, and the
    whole period is doubled until H, the cost of 2^k periods with a free end, stops changing. The period map of the Hamiltonian is never
    formed, so neither fast unstable plants nor long periods overflow. What X misses of its equation, carried through the loop's Lyapunov
    equation, bounds its error and proves that it stabilises.

    References
    ----------
    Hewer, An iterative technique for the computation of the steady state gains for the discrete optimal regulator, IEEE Trans. Automat.
    Control 16 (1971) 382; Anderson, Second-order convergent algorithms for the steady-state Riccati equation, Int. J. Control 28 (1978)
    295 (doubling); Redheffer, On a certain linear fractional transformation, J. Math. Phys. 39 (1960) 269 (star product).

    Examples
    --------
    x' = x + u with unit weights: 2 X - X^2 + 1 = 0.

    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.periodic.riccati.riccati import periodic_riccati
    >>> solution = periodic_riccati(fl.PeriodicSystem([[1.0]], 1.0, B=[[1.0]]), [[1.0]], [[1.0]])
    >>> print(f"{solution.X(0.0).item():.10f} {1 + np.sqrt(2):.10f}")
    2.4142135624 2.4142135624
    >>> solution.error < 1e-9
    True
    """
    posed = linear_quadratic(system, Q, R, N)
    problem, edges = resolve_problem(posed, system)
    check_between(posed, edges)
    tol = positive("tol", tol)
    return solve_by_newton(problem, choose_nodes(problem, edges, tol), None, tol)


def choose_nodes(problem: LinearQuadratic, edges: Array, tol: float) -> Nodes:
    """Equally spaced times where all coefficients are Fourier series, else panels, with few waves of those that are in each."""
    every, T = [highest_wave(one, tol) for one in list_varying(problem)], float(edges[-1])
    most, waves = max(every, default=0.0), max((one for one in every if np.isfinite(one)), default=0.0)
    if PER_WAVE * most <= MOST_NODES:
        return FourierNodes(16 * int(np.ceil(max(WEIGHT_TIMES, PER_WAVE * most) / 16)), T)
    return PanelNodes(divided(edges, T * PANEL_HARMONICS / max(waves, 1.0)), True)


@checked
def finite_horizon_riccati(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    end: ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> RiccatiSolution:
    """Solve the Riccati equation backwards from a cost at the end of the horizon [0, T].

        -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q,   X(T) = end

    Assumes coefficients that are smooth between the system's breaks.

    Parameters
    ----------
    system : PeriodicSystem
        The plant with n states and m inputs; its period is T in s.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        Weight of the states, positive semidefinite.
    R : array_like (m, m), or function of times (N,) -> (N, m, m)
        Weight of the inputs, positive definite.
    end : array_like, shape (n, n)
        Cost at T, symmetric positive semidefinite.
    N : array_like (n, m), or function of times (N,) -> (N, n, m), optional
        Weight of products of states and inputs.
    tol : float
        Wanted `error`, relative to max |X|.

    Returns
    -------
    RiccatiSolution
        X(t), K(t) for 0 <= t <= T, not wrapped.

    Raises
    ------
    ArgumentError
        When a weight does not fit.
    IllPosedSegment
        When a segment has no solution.
    ToleranceNotReached
        When X misses tol by far.

    Examples
    --------
    x' = u with unit weights and no cost at the end: X = tanh(T - t).

    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.periodic.riccati.riccati import finite_horizon_riccati
    >>> solution = finite_horizon_riccati(fl.PeriodicSystem([[0.0]], 2.0, B=[[1.0]]), [[1.0]], [[1.0]], [[0.0]])
    >>> print(f"{solution.X(0.5).item():.9f} {np.tanh(1.5):.9f}")
    0.905148254 0.905148254
    """
    end = real_array("end", end, (system.n, system.n))
    posed = linear_quadratic(system, Q, R, N)
    problem, edges = resolve_problem(posed, system, False)
    check_between(posed, edges)
    return solve_by_newton(problem, PanelNodes(grade_back(problem, edges, end), False), end, positive("tol", tol))


def grade_back(problem: LinearQuadratic, edges: Array, end: Array) -> Array:
    """Edges that halve their distance to the end of each panel, down to the layer in which X leaves what the fastest mode meets there."""
    A, S, Q = problem.reduced(np.nextafter(edges[1:], 0.0))
    rates = np.abs(np.linalg.eigvals(assemble_hamiltonian(A, S, Q))).max(axis=1)
    at_end = float(np.abs(np.linalg.eigvals(A[-1] - S[-1] @ end)).max())  # of the loop under the cost there
    rates[-1] = max(rates[-1], at_end)
    layers = 1 / np.maximum(rates, 1 / edges[-1])
    halvings = np.maximum(np.ceil(np.log2(np.diff(edges) / layers)), 0).astype(int)
    inner = [b - (b - a) * 0.5 ** np.arange(1, k + 1) for (a, b), k in zip(pairwise(edges), halvings, strict=True)]
    return np.unique(np.concatenate([edges, *inner]))


@checked
def periodic_lyapunov(system: PeriodicSystem, Q: MatrixFunction | ArrayLike, tol: float = 1e-9) -> RiccatiSolution:
    """Find the cost x' X x of letting a stable system run.

        -X' = A' X + X A + Q,   X(t + T) = X(t)

    X is positive semidefinite where Q is; Q may be any symmetric matrix. For a covariance, P' = A P + P A' + W, reverse time.

    Parameters
    ----------
    system : PeriodicSystem
        A stable system with n states.
    Q : array_like (n, n), or function of times (N,) -> (N, n, n)
        The right side, symmetric.
    tol : float
        Wanted `error`, relative to max |X|.

    Returns
    -------
    RiccatiSolution
        X(t) with its error; its K(t) is zero.

    Raises
    ------
    ArgumentError
        When Q does not fit.
    NotStable
        When the system is unstable or undecided.
    ToleranceNotReached
        When X misses tol by far.

    References
    ----------
    Bittanti, Colaneri, Periodic Systems (2009), ch. 4.

    Examples
    --------
    >>> import flexlin as fl
    >>> print(f"{fl.periodic_lyapunov(fl.PeriodicSystem([[-2.0]], 1.0), [[1.0]]).X(0.0).item():.10f}")
    0.2500000000
    """
    return solve_lyapunov(system, Q, positive("tol", tol))


def solve_lyapunov(
    system: PeriodicSystem, Q: MatrixFunction | ArrayLike, tol: float, bounded: bool = True
) -> RiccatiSolution:
    """As `periodic_lyapunov`; bounded: whether with errors."""
    weight = check_weight("Q", Q, (system.n, system.n), system.period)
    no_input = Constant(np.zeros((system.n, 1)))
    problem, edges = resolve_problem(LinearQuadratic(system.A, no_input, weight, Constant(np.eye(1)), no_input), system)
    try:
        return solve_by_newton(problem, choose_nodes(problem, edges, tol), None, tol, bounded=bounded)
    except NumericalError:
        need_stable(floquet(system), "the equation has no solution, or none that is known")
        raise


def resolve_problem(
    problem: LinearQuadratic, system: PeriodicSystem, repeats: bool = True
) -> tuple[LinearQuadratic, Array]:
    """Return the problem with its coefficients as series, and the edges of their panels from 0 to T; repeats: whether they go on so."""
    series = {name: resolve_coefficient(given, system, repeats) for name, given in vars(problem).items()}
    edges = reduce(np.union1d, (one.edges for one in series.values()))
    found = {name: Constant(one.mean()) if one.constant else one for name, one in series.items()}
    return replace(problem, **found), edges


def resolve_coefficient(given: MatrixFunction, system: PeriodicSystem, repeats: bool) -> Resolved:
    """One of them: A(t) and B(t) as the system has resolved them, weights by themselves."""
    if repeats and (given is system.A or given is system.B):
        return system.resolved if given is system.A else system.resolved_input
    if repeats or not varies(given, system.period):
        return resolve_beside(system, given)
    complete = system.complete and (given is system.A or given is system.B or has_nothing_narrow(given))
    corners = np.union1d(0.0, system.breaks).tolist()
    return resolve(given, system.period, corners, system.features, complete=complete, repeats=False)


def list_varying(problem: LinearQuadratic) -> list[Resolved]:
    """The coefficients that vary."""
    return [one for one in vars(problem).values() if isinstance(one, Resolved)]


def rough_places(problem: LinearQuadratic, longest: float) -> Array:
    """Return times in [0, T) at which a coefficient is not smooth, or about which it changes in a time below `longest`."""
    varying = list_varying(problem)
    edges = [np.mod(edges_of_short(one.edges, longest), one.period) for one in varying]
    return np.unique(np.concatenate([np.empty(0), *edges, *(one.breaks for one in varying)]))


def highest_wave(coefficient: Resolved, tol: float) -> float:
    """Return the highest harmonic of which an entry has more than tol of its largest, and than is not known; infinity on panels."""
    if not isinstance(coefficient.series, FourierSeries):
        return np.inf
    size = np.abs(coefficient.series.coefficients).max(axis=0)
    large = np.maximum(*map(np.abs, coefficient.series.waves)) > MINOR * tol * size + coefficient.error
    return float(np.flatnonzero(large.any(axis=(1, 2))).max(initial=-1) + 1)
