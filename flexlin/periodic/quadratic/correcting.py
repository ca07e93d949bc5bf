"""The stabilising solution of a smooth problem with fast modes: Newton's method on its series in compiled code, by exponential steps."""

from dataclasses import replace
from math import log

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.backward import (
    correct_until_closed,
    evaluate_residual,
    find_sweeps,
    solve_loop_lyapunov,
)
from flexlin.periodic.quadratic.blocked import bound_sizes
from flexlin.periodic.quadratic.evidence import draw_roundings, weigh_parts
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.resolution import last_harmonic
from flexlin.periodic.quadratic.running_cost import judge_by_cost
from flexlin.periodic.quadratic.samples import PARTS, RiccatiSampler, divide_parts, join_parts
from flexlin.periodic.quadratic.solution import RiccatiSolution
from flexlin.periodic.quadratic.triangle import lower_triangle, triangle_places

FEWEST, MOST, MOST_WORK = 64, 2**12, 1.2e7
"""Nodes of a period, and their number times the cube of that of the states."""
WAVES = 4
"""Nodes for each wave of the coefficients, at least."""
MOST_STATES, TRIES = 24, 8
GROWTH = (1.5, 4.0)
"""The least and the largest factor by which nodes are added."""
LAST, LEAST = 1e-3, 1e-13
"""The change of X that ends Newton's method, relative to tol X, and relative to X at the least."""
HIGHEST, SEEN = 0.75, 0.1
"""The part of the waves behind which none may be larger than this part of tol."""
SHARE = 1e-2
"""Part of tol below which the harmonics are that nodes between others would show."""
BETTER, ROUNDED = 0.5, 10.0
"""The factor by which more nodes must lower the error, and the error of the gain, in units of tol, that they are not made for."""
SPREAD, HELD = 1e10, 1e-6
"""Ratio of X's entries from which on it is looked at, and the part of the size that rounding might make of them that is doubted."""
PROOF, CARRYING = 0.05, 0.1
"""The largest share of the running cost that the residual may be for the error to be of first order; relative accuracy of its parts."""


def solve_by_corrections(problem: LinearQuadratic, period: float, tol: float) -> RiccatiSolution | None:
    """Solve as finely as X has waves, however fast the Hamiltonian's eigenvalues; the best answer, None where this is no way.

    Assumes smooth coefficients.
    """
    library, waves = find_sweeps(), last_harmonic(problem, tol)
    if library is None or not waves * WAVES <= MOST:
        return None
    sampler = RiccatiSampler(problem, period, library)
    few = sampler.sample(PARTS)
    if few.n > MOST_STATES:
        return None
    rate, count, X = few.rate(library), round_up(max(FEWEST, WAVES * waves)), None
    best: RiccatiSolution | None = None
    for _ in range(TRIES):
        if not count <= min(MOST, MOST_WORK / few.n**3):
            break
        samples = sampler.sample(2 * count)
        swept = correct_until_closed(library, samples, period, rate, max(LAST * tol, LEAST), X, SHARE * tol)
        if swept is None:
            count, X = 2 * count, None
            continue
        X, growth = swept.series, count_missing_waves(swept.series, count // 3 - 1, tol)
        if is_out_of_reach(problem, period, X):
            break
        found = judge_by_cost(sampler, samples, X, swept.every, rate, np.inf) if growth <= 1 else None
        if found is not None:
            if max(found.error, found.gain_error) > tol and found.error < PROOF:
                found = carry_through_loop(sampler, X, found)
            if best is not None and found.error > BETTER * best.error:
                break
            best = found
            rounded = best.method_error <= BETTER * best.error
            if rounded or (best.error <= tol and best.gain_error <= ROUNDED * tol):
                break
        count = round_up(count * min(max(growth, GROWTH[0]), GROWTH[1]))
    return best


def round_up(needed: float) -> int:
    """Return a number of nodes, at most an eighth more than needed: one that Fourier transforms like, a multiple of 32."""
    step = max(32, 2 ** int(np.log2(needed)) // 8)
    return step * int(np.ceil(needed / step))


def count_missing_waves(series: Array, H: int, tol: float) -> float:
    """By their fall, how many times as many waves as H a series needs; 1 where the highest are small.

    In units of the states in which X has a diagonal of ones: the gain needs its small entries too.
    """
    last, places = len(series) // 2, triangle_places(series.shape[1])
    rows, columns = lower_triangle(len(places))
    units = np.sqrt(np.abs(series[0, np.diag(places)]))
    both = units[rows] * units[columns]
    size = np.divide(np.abs(series), both, out=np.zeros_like(series), where=both > 0).max(axis=1)
    high = np.maximum(size[1 : last + 1], size[last + 1 :])[int(HIGHEST * H) :].max(initial=0.0)
    return log(SEEN * tol) / log(min(high, 0.9)) if high > SEEN * tol else 1.0


def is_out_of_reach(problem: LinearQuadratic, period: float, series: Array) -> bool:
    """Whether X is as large as that of a mode whose share in the input rounding might have made."""
    heights = np.abs(series[0, np.diag(triangle_places(series.shape[1]))])
    return bool(heights.max() > SPREAD * heights.min() and heights.max() > HELD * bound_sizes(problem, period)[0])


def carry_through_loop(sampler: RiccatiSampler, series: Array, found: RiccatiSolution) -> RiccatiSolution:
    """The solution with what its loop makes of the residual, and of rounding, as in `find_error`, where that is less than the bounds.

    Assumes that these bounds prove the loop stable, and the error to be of first order in the residual.
    """
    library, period, where = sampler.library, sampler.period, triangle_places(series.shape[1])
    samples = sampler.sample(2 * round_up(2 * len(series)))
    at_nodes = evaluate_residual(library, samples, period, series)
    X, slopes, residual = (join_parts(one)[:, where] for one in at_nodes)
    A, S, Q = samples.every_second()
    roundings = [divide_parts(F, True) for F in draw_roundings(A, S, Q, X, slopes)]
    parts = solve_loop_lyapunov(library, samples, period, CARRYING, at_nodes[0], np.stack([at_nodes[2], *roundings]))
    if parts is None:
        return found
    to_gain, cross = samples.to_gain()
    evidence = weigh_parts([join_parts(one)[:, where] for one in parts], X, residual, to_gain, to_gain @ X + cross)
    return replace(
        found,
        error=float(min(found.error, evidence.error)),
        gain_error=float(min(found.gain_error, evidence.gain_error)),
        method_error=min(found.method_error, evidence.method_error),
    )
