"""A linear motion between the times at which it was computed: y, y', y'' by polynomials of fifth degree."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.control.slow_motions import SlowMotions
from flexlin.periodic.system import PeriodicSystem

JUST_BEFORE = 1e-9
"""Of a period: where the coefficients are read just before they jump."""
FINE = 257
"""Times about a node at which a largest deflection is sought; it is flat there."""


@dataclass(frozen=True, eq=False)
class LinearMotion:
    """y(t) in [0, T] between the nodes t (N + 1,); starts, ends (3, N, n): y, y', y'' at the beginning and the end of each interval."""

    t: Array
    starts: Array
    ends: Array

    @classmethod
    def of(cls, system: PeriodicSystem, n: int, slow: SlowMotions) -> "list[LinearMotion]":
        """The motions of a linear system whose first n states are deflections y, and whose next n are y'."""
        t, breaks, near = slow.t, np.array([*system.resolved.breaks, system.period]), JUST_BEFORE * system.period
        jumps = np.flatnonzero((np.abs(t[1:, None] - breaks) < near).any(axis=1))
        after = np.einsum("tij,ktj->kti", system.resolved(t[:-1]), slow.states[:, :-1])
        before = np.einsum("tij,ktj->kti", system.resolved(t[1 + jumps] - near), slow.states[:, 1 + jumps])
        found = []
        for x, right, left in zip(slow.states, after, before, strict=True):
            rates = np.concatenate([right[1:], right[-1:]])
            rates[jumps] = left
            starts = np.array([x[:-1, :n], x[:-1, n : 2 * n], right[:, n : 2 * n]])
            found.append(cls(t, starts, np.array([x[1:, :n], x[1:, n : 2 * n], rates[:, n : 2 * n]])))
        return found

    @property
    def largest(self) -> float:
        """The largest deflection |y_i(t)| over the period."""
        k = int(np.abs(self.starts[0]).max(axis=1).argmax())
        low, high = self.t[max(0, k - 1)], self.t[min(len(self.t) - 1, k + 1)]
        return float(np.abs(self(np.linspace(low, high, FINE))[0]).max())

    def thinned(self) -> "LinearMotion":
        """The same motion from every second node."""
        pairs = len(self.t) // 2 - (len(self.t) % 2 == 0)
        last = slice(2 * pairs, None)
        starts = np.concatenate([self.starts[:, : 2 * pairs : 2], self.starts[:, last]], axis=1)
        ends = np.concatenate([self.ends[:, 1 : 2 * pairs : 2], self.ends[:, last]], axis=1)
        return LinearMotion(np.concatenate([self.t[: 2 * pairs : 2], self.t[last]]), starts, ends)

    def __call__(self, t: Array) -> Array:
        """y, y', y'' at times t (N,) in [0, T]: (3, N, n).

        y = p (h s)^0...2 + b s^3 + c s^4 + d s^5 on [0, 1], with y, y', y'' of both ends.
        """
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        h = np.diff(self.t)[k][:, None]
        s = (t - self.t[k])[:, None] / h
        p, v, a = self.starts[0, k], h * self.starts[1, k], h**2 * self.starts[2, k] / 2
        rise = self.ends[0, k] - (p + v + a)
        slope = h * self.ends[1, k] - (v + 2 * a)
        bend = h**2 * self.ends[2, k] / 2 - a
        b, c, d = 10 * rise - 4 * slope + bend, -15 * rise + 7 * slope - 2 * bend, 6 * rise - 3 * slope + bend
        y = p + s * (v + s * (a + s * (b + s * (c + s * d))))
        rate = v + s * (2 * a + s * (3 * b + s * (4 * c + s * 5 * d)))
        twice = 2 * a + s * (6 * b + s * (12 * c + s * 20 * d))
        return np.array([y, rate / h, twice / h**2])
