"""Where a saturating function of a joint's rate changes fast while the joint follows its basic motion."""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Protocol

import numpy as np

from flexlin.checks import Array

Rates = Callable[[Array], tuple[Array, Array]]
"""Times -> q' and q'' of a joint."""
Features = tuple[tuple[float, float], ...]
"""Pairs (time, half-width) in s, times in [0, T)."""
TURNING_SAMPLES = 8192
"""Times of a period among which turn-arounds are bracketed; two that are closer are found as a minimum of |q'| between them."""
SATURATED_RATES = 20.0
"""Rates over the saturating one at which nothing is left: sech^2(20) is 2e-17."""
WIDE_SHARE = 0.05
"""Of the period: what is wider is not narrow."""
COVERED_WIDTHS = 4.5
"""Where q' leaves zero as t^p, it passes the rate after p times the half-width there; p is at most 4 in the shipped motions."""
DIVISION_PARTS, DIVISION_ROUNDS = 256, 5
"""Into how many parts an interval is divided at a time, and how often: to rounding."""


class Moving(Protocol):
    """What is asked of a basic motion: see `flexlin.motion.Motion`."""

    @property
    def joints(self) -> int: ...
    @property
    def period(self) -> float: ...
    @property
    def breaks(self) -> tuple[float, ...]: ...
    def sample(self, t: Array) -> tuple[Array, Array, Array]: ...
    def __hash__(self) -> int: ...


@lru_cache(maxsize=16)
def slow_passages(motion: Moving, joint: int, rate: float) -> Features:
    """Find where |q'| of a joint is no larger than a saturating rate for a short while.

        f(q'(t) / rate) changes over |q'| < rate:   at a turn-around within rate / |q''|

    Turn-arounds are sign changes of q', and minima of |q'| where it only touches zero; where q' leaves a rest, the passage through
    +-rate. The half-width is the time in which q' changes by `rate`, on the faster side.

    Parameters: rate in rad/s, or m/s.
    Returns: features narrower than T / 20, by rising time; those that another beside them covers are left out.
    """
    T, (of, t, speed, turning, touching) = motion.period, turn_rounds(motion, joint)
    still = touching[np.abs(of(touching)[0]) <= SATURATED_RATES * rate]
    turns = np.union1d(turning, still)
    leaving = crossings(lambda s: np.abs(of(s)[0]) - rate, t, np.abs(speed) - rate)
    with np.errstate(divide="ignore"):
        passing = rate / np.abs(of(leaving)[1])
    narrow = [
        (float(time), float(width), float(covered * width))
        for times, lasting, covered in ((turns, widths(of, turns, rate, T), 1.5), (leaving, passing, COVERED_WIDTHS))
        for time, width in sorted(zip(np.mod(times, T), lasting, strict=True), key=lambda pair: pair[1])
        if 0 < width < WIDE_SHARE * T
    ]
    return uncovered(narrow, T)


@lru_cache(maxsize=8)
def turn_rounds(motion: Moving, joint: int) -> tuple[Rates, Array, Array, Array, Array]:
    """q' and q'' of a joint as a function, times of a period with q' there, its sign changes, and where it may touch zero."""
    T, edges = motion.period, np.unique(np.array(motion.breaks, dtype=float))

    def of(t: Array) -> tuple[Array, Array]:
        if not t.size:
            return t, t
        _, speed, acceleration = motion.sample(np.mod(t.ravel(), T))
        return speed[:, joint].reshape(t.shape), acceleration[:, joint].reshape(t.shape)

    t = np.union1d(T * np.arange(-1, TURNING_SAMPLES + 1) / TURNING_SAMPLES, edges)
    speed, acceleration = of(t)
    bent = crossings(lambda s: of(s)[1], t, acceleration)
    after = np.searchsorted(t, bent)
    beside = np.minimum(np.abs(speed[after - 1]), np.abs(speed[after]))
    touching = bent[np.abs(of(bent)[0]) <= beside]  # minima of |q'|, not its maxima
    t = np.union1d(t, touching)
    speed = of(t)[0]
    return of, t, speed, crossings(lambda s: of(s)[0], t, speed), np.union1d(touching, edges)


def crossings(f: Callable[[Array], Array], t: Array, values: Array) -> Array:
    """Zeros of f between neighbouring times where it changes its sign, and at those where it is zero for an instant."""
    change = values[:-1] * values[1:] < 0
    low, high, sign = t[:-1][change], t[1:][change], np.sign(values[:-1][change])
    low, high = pin_down(lambda s: np.sign(f(s)) == sign, low, high)
    inner = (values[1:-1] == 0) & (values[:-2] != 0) & (values[2:] != 0)
    return np.union1d(0.5 * (low + high), t[1:-1][inner])


def pin_down(before: Callable[[Array], Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Ends (N,) of intervals within which `before` turns false, for times (P, N) at once: what costs is each call, not its times."""
    each = np.arange(len(low))
    for _ in range(DIVISION_ROUNDS):
        t = np.linspace(low, high, DIVISION_PARTS + 1)
        passed = np.logical_and.accumulate(before(t[1:-1])).sum(axis=0)
        low, high = t[passed, each], t[passed + 1, each]
    return low, high


def widths(of: Rates, centres: Array, rate: float, period: float) -> Array:
    """The time in which q' changes by `rate` from its value at each centre, on the faster side; T/2 where it never does."""
    start, none = of(centres)[0], np.zeros(len(centres))

    def near(s: Array, side: float) -> Array:
        return np.abs(of(centres + side * s)[0] - start) < rate

    ends = [pin_down(partial(near, side=side), none, none + period / 2)[1] for side in (1.0, -1.0)]
    return np.minimum(*ends)


def uncovered(narrow: list[tuple[float, float, float]], period: float) -> Features:
    """Those of (time, width, reach) that have no earlier one of the list within their reach: they are resolved with it."""
    kept: list[tuple[float, float]] = []
    for time, width, reach in narrow:
        away = [abs(time - other) for other, _ in kept]
        if all(min(d, period - d) > reach for d in away):
            kept.append((time, width))
    return tuple(sorted(kept))
