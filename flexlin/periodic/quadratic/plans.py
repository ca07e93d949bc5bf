"""How a Riccati equation is solved: as a Fourier series, by Magnus' exponential or by collocation on panels, refined until tol."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError, ToleranceNotReached
from flexlin.periodic.grid import place_edges
from flexlin.periodic.quadratic.doubling import carry_costs
from flexlin.periodic.quadratic.hermite import NODES, PanelPolynomials, interpolate_panels, place_panel_nodes
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.solution import RiccatiSolution
from flexlin.periodic.quadratic.transport import gauss_segments, magnus_segments

STAGES = 8
MAX_SEGMENTS, MAX_WORK = 2**15, 2e11
"""Segments at the most, and the sum over them of the cube of a segment's unknowns: half a minute."""
ROUNDS = 12
TRIAL_PANELS = (32, 128)
MAGNUS_GAIN = 15.0
"""Segments that Magnus' exponential does in the time that collocation needs for one."""
MAGNUS_ORDER = 4
"""Order on which its error figure relies: 6 on slow coefficients, between 4 and 5 was seen beside very fast eigenvalues."""

PROBES, SAFETY = np.array([0.25, 0.75, NODES - 1.75, NODES - 1.25]) / (NODES - 1), 1.5
"""Where in a panel X is held against its equation, and the factor on what that says: the error was up to twice as large."""


def solve_by_plans(
    problem: LinearQuadratic, edges: Array, end: Array | None, tol: float, best: RiccatiSolution | None = None
) -> RiccatiSolution:
    """Solve by the cheapest plan that reaches tol; where none does, hand back the best answer with its status.

    Parameters: edges: of the horizon's parts in which all coefficients are smooth and change as slowly as the part is long.
    """
    for plan in propose_plans(problem, edges, end, tol):
        solution = follow_plan(plan, problem, end, tol)
        if best is None or solution.error < best.error:
            best = solution
        if best.error <= tol:
            return best
    assert best is not None
    if best.error > max(1e-6, 10 * tol):
        raise ToleranceNotReached(
            "the Riccati equation was not solved to the asked accuracy",
            got=f"error {best.error:.2g} with {best.segments} segments",
            expected=f"at most {tol:.2g}",
            todo="scale the states and weights to similar sizes (a small R makes fast modes), or ask for a larger tol",
        )
    few = best.segments < afford_segments(problem) // 4
    return name_limit(best, "rounding" if few else "the number of segments", tol)


def afford_segments(problem: LinearQuadratic) -> int:
    """The most segments of collocation for a problem of its size, whose work is bounded."""
    unknowns = 2 * STAGES * problem.A(np.zeros(1)).shape[1]
    return int(min(MAX_SEGMENTS, max(MAX_WORK / unknowns**3, 4 * NODES)))


def name_limit(best: RiccatiSolution, why: str, tol: float) -> RiccatiSolution:
    """Say in the status what keeps the error above tol."""
    limited = f"limited by {why}: error {best.error:.1g} above the asked {tol:.1g}; ask for tol={2 * best.error:.0e}"
    return replace(best, status=limited)


@dataclass(frozen=True)
class Plan:
    """Panels to start from, stages of collocation (0: Magnus' exponential), the most segments to spend, the answer if known."""

    starts: Array
    stages: int
    most: int
    solved: tuple[RiccatiSolution, Array] | None = None


def propose_plans(problem: LinearQuadratic, edges: Array, end: Array | None, tol: float) -> Iterator[Plan]:
    """Magnus' exponential where a trial promises less work, then collocation.

    Collocation needs c (h rho)^(2 s - 1) = tol for the check's s - 1 stages, rho the Hamiltonian's largest spectral radius and
    c = (s!)^2 / ((2 s)! (2 s + 1)!) the error constant of the diagonal Pade approximation. Magnus' need is seen from the trial.
    """
    s, horizon = STAGES - 1, float(edges[-1])
    powers = np.cumprod(np.append(1.0, np.arange(1, 2 * s + 2)))
    reach = (max(tol, 1e-13) * powers[2 * s] * powers[2 * s + 1] / powers[s] ** 2) ** (1 / (2 * s + 1))
    sampled = problem.hamiltonian(horizon * (np.arange(32) + 0.5) / 32)
    collocated = int(np.ceil(horizon * np.abs(np.linalg.eigvals(sampled)).max() / reach))
    most, affordable = int(min(MAGNUS_GAIN * collocated, MAX_SEGMENTS)), afford_segments(problem)
    for panels in TRIAL_PANELS:
        if collocated < 2 * (NODES - 1) * panels:
            break
        with suppress(NumericalError):
            trial = place_edges(horizon, edges, panels)
            solved = solve_on_panels(trial, problem, end, 0, tol, named=False)
            if solved[0].segments * max(solved[0].method_error / tol, 1.0) ** (1 / MAGNUS_ORDER) < most:
                yield Plan(trial, 0, most, solved)
                break
    panels = min(-(-collocated // (NODES - 1)), affordable // (NODES - 1) // 2)
    yield Plan(place_edges(horizon, edges, max(panels, 4)), STAGES, affordable)


def follow_plan(plan: Plan, problem: LinearQuadratic, end: Array | None, tol: float) -> RiccatiSolution:
    """Refine the plan's panels until the error is below tol or stops falling; the best answer on the way.

    Once it may stay as it is: half of a panel with a steep end is as hard to follow as the whole.
    """
    starts, solved = plan.starts, plan.solved
    best: RiccatiSolution | None = None
    stayed = False
    for _ in range(ROUNDS):
        solution, parts = solved or solve_on_panels(starts, problem, end, plan.stages, tol)
        solved = None
        stays = best is not None and solution.error > 0.9 * best.error
        best = solution if best is None or solution.error < best.error else best
        if stays and stayed:
            return best
        stayed = stays
        finer = split_panels(starts, parts)
        if best.error <= tol or len(finer) == len(starts) or (len(finer) - 1) * (NODES - 1) > plan.most:
            return best
        starts = finer
    assert best is not None
    return best


def solve_on_panels(
    starts: Array,
    problem: LinearQuadratic,
    end: Array | None,
    stages: int = STAGES,
    tol: float = 0.0,
    named: bool = True,
) -> tuple[RiccatiSolution, Array]:
    """Solve on given panels with two accuracies of the segments, and the dense output of the better one.

    named: whether a mode that has no cost is named in the error.
    Returns: the solution, and into how many parts each panel should be split to reach tol.
    """
    at = place_panel_nodes(starts)
    marks = np.append(at[:, :-1].ravel(), starts[-1])
    if stages:
        check, _ = gauss_segments(problem, marks, stages - 1)
        segments, symmetry = gauss_segments(problem, marks, stages)
        every, order = 1, 2 * stages - 2
    else:
        check, _ = magnus_segments(problem, marks[::2])
        segments, symmetry = magnus_segments(problem, marks)
        every, order = 2, MAGNUS_ORDER + 1
    coarse = carry_costs(check, end, problem, marks, named)
    fine = carry_costs(segments, end, problem, marks, named)
    X, size = fine.X, float(np.abs(fine.X).max()) or 1.0
    values = X[np.arange(len(starts) - 1)[:, None] * (NODES - 1) + np.arange(NODES)]
    polynomials = interpolate_panels(starts, values, find_slopes(problem, at, values))
    misses, left_out = find_misses(problem, polynomials)
    left_out /= size
    method_error = float(np.abs(X[::every] - coarse.X).max() / size)
    error = method_error + float(left_out.max()) + fine.closure + fine.rounding
    solution = RiccatiSolution(
        problem=problem,
        horizon=float(starts[-1]),
        periodic=end is None,
        series=polynomials,
        error=float(error),
        gain_error=amplify(problem, at.ravel(), values.reshape(-1, *X.shape[1:]), error * size),
        method_error=method_error,
        residual=measure_residual(problem, starts, misses, size),
        symmetry=symmetry,
        closure=fine.closure,
        doublings=fine.doublings,
        segments=len(marks) - 1,
        status="converged",
    )
    room = max(0.5 * tol, 1e-15)
    for_method = np.ceil(np.clip((method_error / room) ** (1 / order), 1, 8))
    for_output = np.ceil(np.clip((left_out / room) ** (1 / (2 * NODES)), 1, 4))
    return solution, np.maximum(for_method, for_output).astype(int)


def split_panels(starts: Array, parts: Array) -> Array:
    """Split each panel into its number of equal parts."""
    pieces = [np.linspace(a, b, p + 1)[:-1] for (a, b), p in zip(pairwise(starts), parts, strict=True)]
    return np.append(np.concatenate(pieces), starts[-1])


def find_slopes(problem: LinearQuadratic, at: Array, values: Array) -> Array:
    """Return X' at the nodes of each panel; at its ends from inside, since coefficients may jump there."""
    inside = at.copy()
    width = at[:, -1] - at[:, 0]
    inside[:, 0] += 1e-11 * width
    inside[:, -1] -= 1e-11 * width
    rate = problem.rate(inside.ravel(), values.reshape(-1, *values.shape[2:]))
    return rate.reshape(values.shape)


def amplify(problem: LinearQuadratic, t: Array, X: Array, error: float) -> float:
    """Return the largest error of K = R^-1 (B' X + N') that errors of X's entries can make, relative to the largest gain."""
    few = slice(None, None, max(1, len(t) // 256))
    to_gain = np.linalg.solve(problem.R(t[few]), np.swapaxes(problem.B(t[few]), 1, 2))
    gain = float(np.abs(problem.gain(t[few], X[few])).max()) or 1.0
    return float(np.abs(to_gain).sum(axis=2).max() * error / gain)


def find_misses(problem: LinearQuadratic, polynomials: PanelPolynomials) -> tuple[Array, Array]:
    """Return by how much X(t) misses the Riccati equation in each panel between the nodes, and what it leaves out there, both (P,).

    An error 16 E s^2 (1 - s)^2 over a gap h between two nodes, 0 < s < 1, at which X and X' are known, has the slope 3 E / h at its
    quarters and moves X' by at most 2 |A - S X| E: E = |miss| / (3 / h + 2 |A - S X|). It is largest in the outer gaps.
    """
    starts = polynomials.starts
    shape, width = (len(starts) - 1, len(PROBES)), np.diff(starts)
    t = (starts[:-1, None] + width[:, None] * PROBES).ravel()
    values = polynomials(t)
    A, S, _ = problem.reduced(t)
    misses = np.abs(polynomials.rate(t) - problem.rate(t, values)).max(axis=(1, 2)).reshape(shape)
    moved = 2 * np.abs(A - S @ values).sum(axis=2).max(axis=1).reshape(shape)
    left_out = SAFETY * (misses / (3 * (NODES - 1) / width[:, None] + moved)).max(axis=1)
    return misses.max(axis=1), np.maximum(polynomials.tails(), left_out)


def measure_residual(problem: LinearQuadratic, starts: Array, misses: Array, size: float) -> float:
    """Return the largest miss of the Riccati equation between the nodes, relative to |X| times the fastest rate."""
    t = starts[:-1] + PROBES[1] * np.diff(starts)
    fastest = np.abs(np.linalg.eigvals(problem.hamiltonian(t[:: max(1, len(t) // 32)]))).max()
    return float(misses.max() / (size * max(fastest, 1 / starts[-1])))
