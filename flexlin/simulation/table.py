"""A control law as an integrator asks for it: at one time after another."""

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.law import Law, is_constant
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.simulation.marks import INSIDE, find_rough_times

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline, PPoly

KNOTS, MOST_KNOTS = 32, 2**13
"""Between two rough times, at the least and at the most."""
MET = 1e-11
"""Of the law's largest value: what splines may miss midway between their knots."""


class LawTable:
    """A law as offset(t) - gain(t) x, and the rate of its controller; what varies in time by cubic splines, what is constant as it is.

    sampled: the law is asked for at few times, and may be known at these alone.
    """

    def __init__(self, law: Law, lin: Linearization, sampled: bool = False):
        self._periodic, self._period = lin.motion.periodic, lin.period
        few = lin.period * np.array([0.2, 0.6])
        still = [is_constant(part(few)) for part in (law.forward, law.gain, law.reference)]
        self._gain = law.gain(few)[0] if still[1] else None
        self._offset = law.offset(few)[0] if all(still) else None
        rough = np.empty(0) if sampled else find_rough_times(law, lin)

        def tabulate(f: Callable[[Array], Array]) -> Callable[[float], Array]:
            return (lambda t: f(np.array([t]))[0]) if sampled else tabulated(f, lin, rough)

        self._gains = tabulate(law.gain) if self._gain is None else None
        self._offsets = tabulate(law.offset) if self._offset is None else None
        self.controller, self._steer, self._steers = law.controller, law.steer(law.reference(few))[0], None
        if law.controller is not None and not still[2]:
            self._steers = tabulate(lambda t: law.steer(law.reference(t)))

    def __call__(self, t: float, x: Array) -> Array:
        """The torque (m,) at one time; after the end of a one-way motion the law stays as it is there."""
        t = self._now(t)
        offset = self._offset if self._offsets is None else self._offsets(t)
        gain = self._gain if self._gains is None else self._gains(t)
        return offset - gain @ x

    def rate(self, t: float, x: Array, missing: Array) -> Array:
        """z' (k,) of the controller's states at one time, where `missing` (m,) is the torque that is asked but not given."""
        if self.controller is None:
            return x[:0]
        steer = self._steer if self._steers is None else self._steers(self._now(t))
        return self.controller.rates @ x + steer + self.controller.unwinding @ missing

    def _now(self, t: float) -> float:
        return t % self._period if self._periodic else min(t, self._period)


def tabulated(f: Callable[[Array], Array], lin: Linearization, rough: Array) -> "PPoly":
    """A function over one period by cubic splines between the rough times."""
    from scipy.interpolate import PPoly

    marks = np.unique([0.0, *rough, lin.period])
    scale = float(np.abs(f(lin.period * (np.arange(KNOTS) + 0.5) / KNOTS)).max())
    pieces = [spline(f, begin, end, INSIDE * lin.period, MET * scale) for begin, end in pairwise(marks)]
    coefficients = np.concatenate([piece.c for piece in pieces], axis=1)
    return PPoly(coefficients, np.concatenate([*[piece.x[:-1] for piece in pieces], marks[-1:]]))


def spline(f: Callable[[Array], Array], begin: float, end: float, aside: float, tol: float) -> "CubicSpline":
    """A cubic spline with knots doubled until it meets the function midway between them; looked at no nearer to its ends than `aside`."""
    from scipy.interpolate import CubicSpline

    count = KNOTS
    t = np.linspace(begin, end, count + 1)
    values = f(np.clip(t, begin + aside, end - aside))
    while True:
        found, between = CubicSpline(t, values, axis=0), (t[1:] + t[:-1]) / 2
        there = f(between)
        if np.abs(found(between) - there).max() <= tol or count >= MOST_KNOTS:
            return found
        count *= 2
        values = np.insert(values, np.arange(1, len(t)), there, axis=0)
        t = np.insert(t, np.arange(1, len(t)), between)
