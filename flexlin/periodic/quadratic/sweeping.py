"""The stabilising solution of a smooth problem without fast modes: swept backwards over the period, which Newton's method closes."""

import numpy as np

from flexlin.periodic.quadratic.backward import Level, find_sweeps, sweep_until_closed
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic
from flexlin.periodic.quadratic.resolution import last_harmonic
from flexlin.periodic.quadratic.running_cost import judge_by_cost
from flexlin.periodic.quadratic.samples import PARTS, RiccatiSampler
from flexlin.periodic.quadratic.solution import RiccatiSolution

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
RINGING = 60
"""Largest product of period and spectral radius at which eigenvalues may be imaginary: X keeps the rounding of modes that hardly decay."""
FASTEST = 300
"""The largest such product at all: X is cheaper by corrections there."""
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
FINER = 4
"""Times as many nodes at the most as are tried where sweeps do not settle."""
SHARE = 1e-2
"""Part of tol below which the harmonics are that nodes between others would show."""


def solve_by_sweeps(problem: LinearQuadratic, period: float, tol: float) -> RiccatiSolution | None:
    """Solve where the Hamiltonian's eigenvalues are not fast, with a bound below tol on the error; None where this is no way.

    Assumes smooth coefficients.
    """
    library, waves = find_sweeps(), last_harmonic(problem, tol)
    if library is None or not waves * WAVES <= MOST:
        return None
    sampler = RiccatiSampler(problem, period, library)
    few = sampler.sample(PARTS)
    states = few.n
    if states > MOST_STATES:
        return None
    most = min(MOST, MOST_ENTRIES // states**2)
    rate = few.rate(library)
    order, turns, X = max(ORDERS), rate * period, None
    if turns > FASTEST or (turns > RINGING and few.rings()):
        return None
    least = max(WAVES * waves, turns / LARGEST, FEWEST)
    usual = USUAL + min(SLOPE[0] + SLOPE[1] * waves, SLOPE[2]) * min(turns, SLOW)
    needed = min(max(least, usual * tol ** (-1 / order)), max(least, most / 2))
    near, first = max(LAST * tol, LEAST), needed
    found = None
    for attempt in range(TRIES):
        if not needed <= most:
            break
        count = round_up(needed)
        samples = sampler.sample(2 * count)
        levels = plan_levels(count, turns / count, near, X is None)
        swept = sweep_until_closed(library, samples, period, levels, X, SHARE * tol)
        if swept is None:
            if X is not None or needed >= FINER * first:
                break
            needed *= 2
            continue
        X = swept.series
        found = judge_by_cost(sampler, samples, X, swept.every, rate, tol if attempt else np.inf)
        if found is None:
            break
        missed = max(found.error, found.gain_error) / tol
        if missed <= 1:
            return found
        needed = max(count + 1, count * (missed / AIM) ** (1 / order))
        near = max(CLOSER**attempt * near, CLOSEST)
    return found if found is not None and found.error <= tol else None


def round_up(needed: float) -> int:
    """Return a number of nodes, at most an eighth more than needed: one that Fourier transforms like, a multiple of 32."""
    step = max(32, 2 ** int(np.log2(needed)) // 8)
    return step * int(np.ceil(needed / step))


def plan_levels(count: int, turn: float, near: float, cold: bool) -> list[Level]:
    """Return the levels of sweeps on N nodes: that on all of them, and where nothing is known of X those before it.

    Parameters: turn: the Hamiltonian's spectral radius times a step.
    """
    nodes, last = count // PARTS, Level(1, highest_order(turn, max(ORDERS)), near)
    starts = [
        Level(every, order, end)
        for every, most, end in STARTS
        if cold and nodes % every == 0 and (order := highest_order(every * turn, min(most, nodes // every)))
    ]
    return [*starts, last]


def highest_order(turn: float, most: int) -> int:
    """Return the highest order, up to a given one, that is stable at a step; 0 where none is."""
    return max((order for order, reach in ORDERS.items() if order <= most and turn <= reach), default=0)
