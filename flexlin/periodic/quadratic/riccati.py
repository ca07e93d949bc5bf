"""Riccati and Lyapunov equations of periodic systems and of finite horizons, on grids that step over no fast change."""

from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import NotStable, NumericalError
from flexlin.periodic.coefficients import Constant, MatrixFunction, has_nothing_narrow, varies
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.fourier import FourierSeries, fourier_nodes, real_fourier_coefficients
from flexlin.periodic.grid import divided, edges_of_short
from flexlin.periodic.precision import MINOR
from flexlin.periodic.quadratic.linear_quadratic import (
    SAMPLES,
    WAVES,
    LinearQuadratic,
    RiccatiSolution,
    assemble_hamiltonian,
    check_between,
    linear_quadratic,
)
from flexlin.periodic.quadratic.newton import MOST, solve_by_newton
from flexlin.periodic.quadratic.nodes import FourierNodes, Nodes, PanelNodes
from flexlin.periodic.related import with_matrices
from flexlin.periodic.resolved.matrix import ResolvedCompanion, ResolvedMatrix
from flexlin.periodic.resolved.resolve import resolve, resolve_port
from flexlin.periodic.resolved.sampling import BLOCKS
from flexlin.periodic.system import PeriodicSystem, as_system

PER_WAVE = 4
"""Nodes for each wave of the coefficients on which X is sought first."""
FEW = 2
"""Harmonics so few that it does not matter which of them are small."""
OTHERS = ("B", "Q", "R", "N")


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
        X(t), K(t) with error, residual, doublings, segments, status.

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
    >>> from flexlin.periodic.quadratic.riccati import periodic_riccati
    >>> solution = periodic_riccati(fl.PeriodicSystem([[1.0]], 1.0, B=[[1.0]]), [[1.0]], [[1.0]])
    >>> print(f"{solution.X(0.0).item():.10f} {1 + np.sqrt(2):.10f}")
    2.4142135624 2.4142135624
    >>> solution.error < 1e-9
    True
    """
    system = as_system(system)
    posed = linear_quadratic(system, Q, R, N)
    problem, edges = resolve_problem(posed, system)
    check_between(posed, edges)
    tol = positive("tol", tol)
    return solve_by_newton(problem, choose_nodes(problem, edges, tol), None, tol)


def choose_nodes(problem: LinearQuadratic, edges: Array, tol: float) -> Nodes:
    """Equally spaced times where the coefficients are smooth all over, else panels on which they are."""
    waves = last_harmonic(problem, tol)
    if PER_WAVE * waves <= MOST:
        return FourierNodes(16 * int(np.ceil(max(SAMPLES, PER_WAVE * waves) / 16)), float(edges[-1]))
    return PanelNodes(divide_for_waves(problem, edges, tol), True)


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
    >>> from flexlin.periodic.quadratic.riccati import finite_horizon_riccati
    >>> solution = finite_horizon_riccati(fl.PeriodicSystem([[0.0]], 2.0, B=[[1.0]]), [[1.0]], [[1.0]], [[0.0]])
    >>> print(f"{solution.X(0.5).item():.9f} {np.tanh(1.5):.9f}")
    0.905148254 0.905148254
    """
    system = as_system(system)
    end = real_array("end", end, (system.n, system.n))
    problem = linear_quadratic(system, Q, R, N)
    edges = find_edges(problem, system)
    check_between(problem, edges)
    return solve_by_newton(problem, PanelNodes(grade_back(problem, edges, end), False), end, positive("tol", tol))


def grade_back(problem: LinearQuadratic, edges: Array, end: Array) -> Array:
    """Edges that halve their distance to the end of each panel, down to the layer in which X leaves what the fastest mode meets there."""
    A, S, Q = problem.reduced(np.nextafter(edges[1:], 0.0))
    rates = np.abs(np.linalg.eigvals(assemble_hamiltonian(A, S, Q))).max(axis=1)
    rates[-1] = max(
        rates[-1], float(np.abs(np.linalg.eigvals(A[-1] - S[-1] @ end)).max())
    )  # of the loop under the cost at the end
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
    system = as_system(system)
    idle = with_matrices(system, system.A, Constant(np.zeros((system.n, 1))))
    vars(idle)["resolved"] = system.resolved
    posed = linear_quadratic(idle, Q, np.eye(1), definite=False)
    problem, edges = resolve_problem(posed, idle)
    tol = positive("tol", tol)
    try:
        return solve_by_newton(problem, choose_nodes(problem, edges, tol), None, tol)
    except NumericalError:
        found = floquet(system)
        if found.verdict != "stable":
            raise NotStable(
                "the equation has no solution, or none that is known", got=found.status, expected="a stable system"
            ) from None
        raise


def resolve_problem(problem: LinearQuadratic, system: PeriodicSystem) -> tuple[LinearQuadratic, Array]:
    """Return the problem with its coefficients as series, and the edges of their panels from 0 to T."""
    state = system.resolved
    found: dict[str, MatrixFunction] = {"A": Constant(state.mean()) if state.constant else state}
    edges = system.resolved.edges
    for name in OTHERS:
        given = getattr(problem, name)
        complete = system.complete and has_nothing_narrow(given)
        named = system.period, system.breaks, system.features, complete
        series = system.resolved_input if given is system.B else resolve_port(given, *named)
        found[name] = Constant(series.mean()) if series.constant else series
        edges = edges if np.array_equal(edges, series.edges) else np.union1d(edges, series.edges)
    return replace(problem, **found), edges


def find_edges(problem: LinearQuadratic, system: PeriodicSystem) -> Array:
    """Return edges from 0 to T between which polynomials follow every coefficient, which need not repeat."""
    weights = (problem.Q, problem.R, problem.N)
    known = [(problem.A, True), (problem.B, True), *((one, has_nothing_narrow(one)) for one in weights)]
    corners = {0.0, *system.breaks}
    named = system.period, sorted(corners), system.features
    panels = (
        resolve(one, *named, complete=system.complete and nothing_narrow, repeats=False).edges
        for one, nothing_narrow in known
        if varies(one, system.period)
    )
    return reduce(np.union1d, panels, np.array([*sorted(corners), system.period]))


def divide_for_waves(problem: LinearQuadratic, edges: Array, tol: float) -> Array:
    """Divide the parts of the period until none holds more waves of a Fourier series than a panel follows."""
    smooth = (one for one in coefficients(problem) if isinstance(one.series, FourierSeries))
    waves = max((highest_wave(one, tol) for one in smooth), default=1.0)
    return divided(edges, float(edges[-1]) * WAVES / max(waves, 1.0))


def last_harmonic(problem: LinearQuadratic, tol: float) -> float:
    """Return the highest harmonic of the coefficients that matters at tol; infinity where one is not smooth or changes in a short time."""
    return max((highest_wave(one, tol) for one in coefficients(problem)), default=0.0)


def coefficients(problem: LinearQuadratic) -> list[ResolvedMatrix | ResolvedCompanion]:
    """Those that vary."""
    every = (getattr(problem, name) for name in ("A", *OTHERS))
    return [one for one in every if isinstance(one, ResolvedMatrix | ResolvedCompanion)]


def rough_places(problem: LinearQuadratic, longest: float) -> Array:
    """Return times in [0, T) at which a coefficient is not smooth, or about which it changes in a time below `longest`."""
    if all(one.panels == 1 for one in coefficients(problem)):
        return np.empty(0)
    edges = (np.mod(edges_of_short(one.edges, longest), one.period) for one in coefficients(problem))
    return reduce(np.union1d, edges, np.array([place for one in coefficients(problem) for place in one.breaks]))


def highest_wave(coefficient: ResolvedMatrix | ResolvedCompanion, tol: float) -> float:
    """Return the highest harmonic above tol of the largest and above what is known of the coefficient."""
    series, T = coefficient.series, coefficient.period
    if coefficient.breaks or np.diff(coefficient.edges).min() < T / BLOCKS:
        return np.inf
    if isinstance(series, FourierSeries) and series.degree <= FEW:
        return float(series.degree)
    values = None if isinstance(series, FourierSeries) else series(fourier_nodes(16 * BLOCKS, T))
    waves = series.coefficients if values is None else real_fourier_coefficients(values)
    H, last = len(waves) // 2, 0
    parts = coefficient.split if isinstance(coefficient, ResolvedCompanion) else lambda all_: (all_,)
    for part, known in zip(parts(waves), parts(coefficient.error), strict=True):
        size = np.abs(part).max(axis=(1, 2))
        floor = max(MINOR * tol * size.max(), float(known.max()))
        large = np.maximum(size[1 : H + 1], size[H + 1 :]) > floor
        last = max(last, int(np.flatnonzero(large).max(initial=-1)) + 1)
    return float(last)
