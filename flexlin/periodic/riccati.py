"""The periodic Riccati equation by segments in scattering form, combined in a tree and doubled until the cost stands still."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive, real_array, times
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.blocked import blocked_mode, sizes_without_coupling
from flexlin.periodic.collocation import gauss, nodes, samples, transitions
from flexlin.periodic.grid import edges
from flexlin.periodic.hermite import NODES, PanelPolynomials, interpolate, panel_nodes
from flexlin.periodic.linear_quadratic import LinearQuadratic, linear_quadratic
from flexlin.periodic.scattering import Segment, costs_at_edges, from_hamiltonian, product_tree, star_product
from flexlin.periodic.system import MatrixFunction, PeriodicSystem

STAGES = 8
MAX_SEGMENTS = 2**15
MAX_DOUBLINGS = 64
ROUNDS = 8
ROUNDING = 64 * np.finfo(float).eps
"""Relative error that rounding makes in one period: a few units for each of the operations that touch an entry."""


@dataclass(frozen=True)
class RiccatiSolution:
    """X(t) and the gain K(t) of a linear-quadratic problem, at any time, with the evidence that they are right.

    `error` bounds |X error| / max |X| over the horizon: the difference to a second order of collocation plus what the dense
    output leaves out. `residual` is how far X(t) misses its differential equation between the nodes, relative to |X| per
    fastest time constant; `closure` is |X(T) - X(0)| / |X| (0 for a finite horizon); `symmetry` is the largest relative
    asymmetry of a segment's cost before it was symmetrised. Times are wrapped into the period when `periodic`.
    """

    problem: LinearQuadratic
    horizon: float
    periodic: bool
    polynomials: PanelPolynomials
    error: float
    residual: float
    symmetry: float
    closure: float
    doublings: int
    segments: int
    status: str

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix at times t (N,): (N, n, n)."""
        return self.polynomials(self._inside(t))

    def K(self, t: ArrayLike) -> Array:
        """Return the gain K = R^-1 (B' X + N') at times t (N,): (N, m, n)."""
        inside = self._inside(t)
        return self.problem.gain(inside, self.polynomials(inside))

    def _inside(self, t: ArrayLike) -> Array:
        checked = times(t)
        return np.mod(checked, self.horizon) if self.periodic else np.clip(checked, 0.0, self.horizon)


def periodic_riccati(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> RiccatiSolution:
    """Find the stabilising periodic solution of the Riccati differential equation.

        -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q,   X(t + T) = X(t)

    Each segment's Hamiltonian transition matrix is brought to scattering form; segments combine by the Redheffer star
    product; the whole period is doubled until H, the cost of 2^k periods with a free end, stops changing. The period map of
    the Hamiltonian is never formed, so neither fast unstable plants nor long periods overflow.
    Assumes (A, B) stabilisable, (Q, A) detectable, coefficients smooth between the system's breaks.

    Parameters: system with input; Q (n, n), R (m, m), N (n, m): constants or functions (N,) -> (N, ., .); tol: wished `error`.
    Returns: X(t), K(t) with error, residual, symmetry, closure, doublings, segments, status.
    Raises: ArgumentError on weights; NotStabilizable, NotDetectable, IllPosedSegment, ToleranceNotReached.
    Source: Anderson, Int. J. Control 28 (1978) 295 (doubling); Redheffer, J. Math. Phys. 39 (1960) 269 (star product).
    """
    return refined(linear_quadratic(system, Q, R, N), system.period, system.breaks, None, positive("tol", tol))


def finite_horizon_riccati(
    system: PeriodicSystem,
    Q: MatrixFunction | ArrayLike,
    R: MatrixFunction | ArrayLike,
    end: ArrayLike,
    N: MatrixFunction | ArrayLike | None = None,
    tol: float = 1e-9,
) -> RiccatiSolution:
    """Solve the Riccati equation backwards from a cost at the end of the horizon [0, T], T the system's period.

        -X' = A' X + X A - (X B + N) R^-1 (B' X + N') + Q,   X(T) = end

    Assumes and takes what `periodic_riccati` does; end (n, n) symmetric positive semidefinite.
    Returns: X(t), K(t) for 0 <= t <= T, not wrapped.
    Raises: ArgumentError, IllPosedSegment, ToleranceNotReached.
    """
    end = real_array("end", end, (system.n, system.n))
    return refined(linear_quadratic(system, Q, R, N), system.period, system.breaks, end, positive("tol", tol))


def refined(
    problem: LinearQuadratic, horizon: float, breaks: tuple[float, ...], end: Array | None, tol: float
) -> RiccatiSolution:
    """Solve on finer and finer panels until the error is below tol or rounding stops it."""
    segments = first_guess(problem, horizon, tol)
    best: RiccatiSolution | None = None
    for _ in range(ROUNDS):
        solution = solve_on(edges(horizon, breaks, -(-segments // (NODES - 1))), problem, end)
        if solution.error <= tol:
            return solution
        if best is not None and solution.error > 0.5 * best.error:
            break
        best = solution
        segments = int(solution.segments * np.clip((solution.error / tol) ** (1 / 9), 1.25, 4.0))
        if segments > MAX_SEGMENTS:
            break
    assert best is not None
    if best.error > 1e-6:
        raise ToleranceNotReached(
            "the Riccati equation was not solved to the asked accuracy",
            got=f"error {best.error:.2g} with {best.segments} segments",
            expected=f"at most {tol:.2g}",
            todo="scale the states and weights to similar sizes, declare jumps of A(t) as breaks, or ask for a larger tol",
        )
    limited = f"limited by rounding: error {best.error:.1g} above the asked {tol:.1g}; ask for tol={2 * best.error:.0e}"
    return replace(best, status=limited)


def first_guess(problem: LinearQuadratic, horizon: float, tol: float) -> int:
    """Segments h with c (h rho)^(2 s - 1) = tol for the check's s - 1 stages, rho the Hamiltonian's largest spectral radius.

    c = (s!)^2 / ((2 s)! (2 s + 1)!) is the error constant of the diagonal Pade approximation of the exponential.
    """
    s = STAGES - 1
    powers = np.cumprod(np.append(1.0, np.arange(1, 2 * s + 2)))
    reach = (max(tol, 1e-13) * powers[2 * s] * powers[2 * s + 1] / powers[s] ** 2) ** (1 / (2 * s + 1))
    sampled = problem.hamiltonian(horizon * (np.arange(32) + 0.5) / 32)
    radius = np.abs(np.linalg.eigvals(sampled)).max()
    return int(np.clip(np.ceil(horizon * radius / reach), 4 * (NODES - 1), MAX_SEGMENTS))


def solve_on(starts: Array, problem: LinearQuadratic, end: Array | None) -> RiccatiSolution:
    """Solve on given panels, with two orders of collocation and the dense output of the better one."""
    at = panel_nodes(starts)
    marks = np.append(at[:, :-1].ravel(), starts[-1])
    coarse, *_ = costs(marks, problem, end, STAGES - 1)
    X, symmetry, closure, doublings, rounding = costs(marks, problem, end, STAGES)
    size = np.abs(X).max() or 1.0
    values = np.stack(
        [X[i : len(X) - NODES + 1 + i : NODES - 1] for i in range(NODES - 1)] + [X[NODES - 1 :: NODES - 1]], 1
    )
    polynomials = interpolate(starts, values, slopes_inside(problem, at, values))
    return RiccatiSolution(
        problem=problem,
        horizon=float(starts[-1]),
        periodic=end is None,
        polynomials=polynomials,
        error=float(np.abs(X - coarse).max() / size + polynomials.tail() / size + closure + rounding),
        residual=relative_residual(problem, polynomials, size),
        symmetry=symmetry,
        closure=closure,
        doublings=doublings,
        segments=len(marks) - 1,
        status="converged",
    )


def costs(
    marks: Array, problem: LinearQuadratic, end: Array | None, stages: int
) -> tuple[Array, float, float, int, float]:
    """Return X at all marks, the segments' asymmetry, the closure, the number of doublings, and the share of rounding.

    A rounding error made once in every period adds up over the periods that the closed loop remembers.
    """
    rule = gauss(stages)
    Phi = transitions(samples(problem.hamiltonian, nodes(marks, rule.c)), np.diff(marks), rule)
    segments, symmetry = from_hamiltonian(Phi)
    levels = product_tree(segments)
    if end is not None:
        return costs_at_edges(levels, end), symmetry, 0.0, 0, ROUNDING
    last, doublings, memory = doubled(segments, levels[-1][0], problem, marks)
    X = costs_at_edges(levels, last)
    closure = float(np.abs(X[0] - last).max() / (np.abs(X).max() or 1.0))
    return X, symmetry, closure, doublings, ROUNDING * memory


def doubled(segments: Segment, period: Segment, problem: LinearQuadratic, marks: Array) -> tuple[Array, int, float]:
    """Double one period until the cost H of 2^k periods stops changing and the loop's memory F is gone.

    Returns: H, the number of doublings, and the norm of the sum of (F^k)' F^k over all periods: the loop's memory.
    Raises: NotStabilizable when H grows for ever; NotDetectable when G does, or F does not decay.
    """
    limits = sizes_without_coupling(problem, float(marks[-1]))
    whole, scale, memory = period, max(float(np.abs(period.F).max()), 1.0), np.eye(len(period.F))
    for k in range(MAX_DOUBLINGS):
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


def slopes_inside(problem: LinearQuadratic, at: Array, values: Array) -> Array:
    """Return X' at the nodes of each panel; at its ends from inside, since coefficients may jump there."""
    inside = at.copy()
    width = at[:, -1] - at[:, 0]
    inside[:, 0] += 1e-11 * width
    inside[:, -1] -= 1e-11 * width
    rate = problem.rate(inside.ravel(), values.reshape(-1, *values.shape[2:]))
    return rate.reshape(values.shape)


def relative_residual(problem: LinearQuadratic, polynomials: PanelPolynomials, size: float) -> float:
    """Return the largest miss of the Riccati equation between the nodes, relative to |X| times the fastest rate."""
    starts = polynomials.starts
    t = (starts[:-1, None] + np.diff(starts)[:, None] * np.array([0.0843, 0.4127, 0.8871])).ravel()
    miss = polynomials.rate(t) - problem.rate(t, polynomials(t))
    fastest = np.abs(np.linalg.eigvals(problem.hamiltonian(t[:: max(1, len(t) // 32)]))).max()
    return float(np.abs(miss).max() / (size * max(fastest, 1 / starts[-1])))
