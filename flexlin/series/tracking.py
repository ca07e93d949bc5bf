"""Solutions z(t) of F(z, t) = 0 followed in time by Newton's method, and where they turn or come near a singular place."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from flexlin.checks import SUM_ROUNDING, Array

Step = Callable[[float, Array], Array]
"""Time and place to Newton's step F_z^-1 F."""
NEWTON_STEPS, CONTRACTION = 8, 16
"""Newton's steps at each time, and how much shorter each must be than the one before."""
SHORTEST_STEP = 1e-10
"""Of a period, the shortest step, and how exactly a time is found; also of an interval in which a least value is sought."""
SUSPECT_CONDITION, SINGULAR_CONDITION = 0.05, 1e-6
"""Reciprocal condition numbers below which a matrix is looked at closer where it is least, and called singular."""


def newton_from(step: Step, t: float, z: Array) -> Array | None:
    """z with F(z, t) = 0, by steps that shrink fast from the first one on; None where they do not."""
    last = np.inf
    for _ in range(NEWTON_STEPS):
        change = step(t, z)
        size = float(np.abs(change).max(initial=0.0))
        if not size < max(last / CONTRACTION, SUM_ROUNDING):
            return None
        z, last = z - change, size
        if size < SUM_ROUNDING * (1 + float(np.abs(z).max(initial=0.0))):
            return z
    return None


def track(step: Step, z: Array, a: float, b: float, shortest: float) -> tuple[Array | None, float]:
    """The solution at time b from the one at a, over steps that are halved where Newton's method fails, and doubled where not.

    Returns: the solution, or None where no step leads on, and the time that was reached.
    """
    width, at = b - a, a
    while at < b:
        there = min(at + width, b)
        found = newton_from(step, there, z)
        if found is not None:
            z, at, width = found, there, 2 * width
        elif width < shortest:
            return None, at
        else:
            width /= 2
    return z, at


def follow(step: Step, z: Array, t: Array, shortest: float) -> tuple[Array, float | None]:
    """The solutions at the first of times t (N,) from z on, as many as are reached, and the time at which they end where they do."""
    found, at = [z], float(t[0])
    for a, b in pairwise(t):
        there, at = track(step, found[-1], a, b, shortest)
        if there is None:
            return np.array(found), at
        found.append(there)
    return np.array(found), None


def find_singular(
    t: Array, z: Array, step: Step, matrix: Callable[[Array, Array], Array], shortest: float
) -> tuple[float, float] | None:
    """The first time at which a matrix V becomes singular, and its reciprocal condition number there, 0 where det V turns its sign.

    Parameters: z (N, n) at times t (N,), followed between them by `step`; matrix: V (N, k, k) by times and places;
    shortest: how exactly a turn is found.
    """

    from scipy.optimize import bisect  # takes longer to load than most motions to look through

    def between(at: float, k: int) -> Array:
        found, reached = track(step, z[k], float(t[k]), at, shortest)
        return matrix(np.array([reached]), (z[k] if found is None else found)[None])[0]

    def side(at: float, k: int) -> float:
        return 1.0 if np.linalg.slogdet(between(at, k))[0] == signs[k] else -1.0

    V = matrix(t, z)
    signs, size = np.linalg.slogdet(V)[0], 1 / np.linalg.cond(V)
    for k in range(1, len(t)):
        if signs[k] != signs[k - 1]:
            return float(bisect(side, t[k - 1], t[k], (k - 1,), shortest)), 0.0
        if 1 < k < len(t) and size[k - 1] <= min(size[k - 2], size[k], SUSPECT_CONDITION):
            at, found = find_lowest(lambda at, k=k: 1 / np.linalg.cond(between(at, k - 2)), t[k - 2], t[k])  # type: ignore[misc]
            if found < SINGULAR_CONDITION:
                return at, found
    return None


def find_lowest(value: Callable[[float], float], a: float, b: float) -> tuple[float, float]:
    """Where between a and b a function is least, and its value there."""
    from scipy.optimize import minimize_scalar

    found = minimize_scalar(value, bounds=(a, b), method="bounded", options={"xatol": SHORTEST_STEP * (b - a)})
    return float(found.x), float(found.fun)
