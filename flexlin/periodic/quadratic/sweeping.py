"""The stabilising solution of a smooth problem without fast modes: swept backwards over the period, which Newton's method closes."""

import ctypes

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import fourier_nodes
from flexlin.periodic.quadratic.backward import Level, RiccatiSampler, RiccatiSamples, find_sweeps, sweep_until_closed
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.resolution import last_harmonic
from flexlin.periodic.quadratic.running_cost import judge_by_cost
from flexlin.periodic.quadratic.solution import RiccatiSolution
from flexlin.periodic.quadratic.triangle import fold_few, unfold_triangle

FEWEST, MOST, MOST_ENTRIES = 128, 2**13, 2**22
"""Nodes of a period, and entries of X at all of them."""
USUAL, SLOPE, SLOW = 22.5, (0.45, 0.13, 1.0), 40
"""Nodes that a problem needs, as seen: USUAL, and a slope times period and spectral radius of the Hamiltonian, by tol^(1 / p) for the
highest order p. The slope begins at the first, grows by the second with each wave of the coefficients, and ends at the third. Of the
product no more than SLOW counts: what is faster than that hardly shows in X."""
AIM = 0.3
"""Part of tol at which more nodes aim."""
ORDERS = {10: 0.075, 8: 0.15, 6: 0.2, 4: 0.36, 3: 0.5}
"""Orders of Adams' method, and the largest product of a step and the Hamiltonian's spectral radius at which each is stable."""
STARTS = ((8, 4, 1e-2), (4, 6, 1e-2), (2, 8, 1e-3))
"""Sweeps start on few nodes: every so many of them; the highest order; and the change of X(T), relative to X, after which more follow."""
RINGING = 130
"""Largest product of period and spectral radius at which eigenvalues may be imaginary: X keeps the rounding of modes that hardly decay."""
LARGEST = 0.165
"""The largest such product on all nodes."""
WAVES = 16
"""Nodes for each wave of the coefficients, at least."""
MOST_STATES = 24
LAST, LEAST = 1e-3, 2e-13
"""The change of X(T) that ends the sweeps on all nodes, relative to tol X, and relative to X at the least."""
CLOSER, CLOSEST = 0.05, 5e-14
"""The factor on it for the next try, and what rounding leaves of it."""
TRIES = 3
SHARE = 1e-2
"""Part of tol below which the harmonics are that nodes between others would show."""
LOOKS = 4
"""Times at which the Hamiltonian's eigenvalues are measured."""


def solve_by_sweeps(problem: LinearQuadratic, period: float, tol: float) -> RiccatiSolution | None:
    """Solve where the Hamiltonian's eigenvalues are not fast, with a bound below tol on the error; None where this is no way.

    Assumes smooth coefficients.
    """
    library, waves = find_sweeps(), last_harmonic(problem, tol)
    if library is None or not waves * WAVES <= MOST:
        return None
    sampler = RiccatiSampler(problem, period, library)
    few = sampler.sample(LOOKS)
    _, states, width = few.shape
    if states > MOST_STATES:
        return None
    most = min(MOST, MOST_ENTRIES // (states * width))
    rate = few.rate(library)
    order, turns, X = max(ORDERS), rate * period, None
    if turns > RINGING and few.rings():
        return None
    least = max(WAVES * waves, turns / LARGEST, FEWEST)
    usual = USUAL + min(SLOPE[0] + SLOPE[1] * waves, SLOPE[2]) * min(turns, SLOW)
    needed = min(max(least, usual * tol ** (-1 / order)), max(least, most / 2))
    near = max(LAST * tol, LEAST)
    for _ in range(TRIES):
        if not needed <= most:
            return None
        count = round_up(needed)
        samples = sampler.sample(count)
        with np.errstate(all="ignore"):
            values = sweep(library, samples, period, X, turns / count, near)
            if values is None:
                return None
            X, every = fold_few(values, SHARE * tol)
            between = samples.between(every) if every > 1 else sampler.sample(count, True)
            found = judge_by_cost(sampler, between, X, rate, tol)
        if found is None or found.error <= tol:
            return found
        needed, near = max(count + 1, count * (found.error / (AIM * tol)) ** (1 / order)), max(CLOSER * near, CLOSEST)
    return None


def round_up(needed: float) -> int:
    """Return a number of nodes, at most an eighth more than needed: one that Fourier transforms like, a multiple of sixteen."""
    step = max(16, 2 ** int(np.log2(needed)) // 8)
    return step * int(np.ceil(needed / step))


def sweep(
    library: ctypes.CDLL, samples: RiccatiSamples, period: float, start: Array | None, turn: float, near: float
) -> Array | None:
    """Return X at the nodes, lower triangles (n (n + 1) / 2, N); from X = 0, the cost of a finite horizon, or from amplitudes.

    Parameters: turn: the Hamiltonian's spectral radius times a step.
    """
    levels = [Level(every, order, end) for every, most, end in STARTS if (order := highest_order(every * turn, most))]
    last = Level(1, highest_order(turn, max(ORDERS)), near)
    begin = None
    if start is not None:
        begin = unfold_triangle(start, period)(fourier_nodes(samples.count, period)[: last.order])
    return sweep_until_closed(library, samples, period, (*levels, last) if start is None else (last,), begin)


def highest_order(turn: float, most: int) -> int:
    """Return the highest order, up to a given one, that is stable at a step; 0 where none is."""
    return max((order for order, reach in ORDERS.items() if order <= most and turn <= reach), default=0)
