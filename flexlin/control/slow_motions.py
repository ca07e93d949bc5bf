"""The linear motions that decay slowest, from Floquet modes: nothing is multiplied out over a period."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import SAMPLES, Array, check_size
from flexlin.errors import NumericalError
from flexlin.periodic.floquet.decoupled import solve_decoupled_modes
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import find_coinciding
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.product import balance_factors, periodic_vectors
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import METHODS, choose_setting, factor_by, place_segments

TOLERANCE = 1e-6
"""Error of the exponents, in 1/s, that is enough for a direction."""
SLOW_TOL = 1e-6
"""Accuracy that is asked of the segments where the exponents came without any; an L-stable method damps what is fast."""
GONE = 200.0
"""A mode that decays by exp(-GONE) from one sample to the next has no motion to show."""
GROUPS = 64
"""Into so many products the transition matrices of a period are multiplied: over so small a part of it the slowest modes part by little."""
COARSE = 64
"""Times of a period at which a motion is given, at the least, where a direction is all that is asked for."""
REAL = 1e-6
"""An imaginary part this small against the real one belongs to a real mode."""


@dataclass(frozen=True)
class SlowMotions:
    """Real motions x(t) = Re p(t) exp(lambda t) and Im p(t) exp(lambda t) of the slowest modes.

    Each is scaled to a largest deflection of 1 (rad or m) over a period.
    directions (k, 2n): x(0); t (N,): times in [0, T]; states (k, N, 2n): x(t).
    """

    directions: Array
    t: Array
    states: Array


def no_motion(result: FloquetResult) -> NumericalError:
    """What to say where no mode can be followed through a period."""
    if not np.isfinite(result.errors).any():
        return NumericalError("no Floquet mode is resolved", todo="look at the Floquet verdict")
    growth = float(result.exponents.real.max())
    return NumericalError(
        "every Floquet mode dies out between two samples of the period",
        got=f"the slowest at {growth:.3g} 1/s with a period of {result.period:.3g} s",
        todo="look at a motion of a shorter period: this one hardly moves while its modes do",
    )


def slow_motions(
    system: PeriodicSystem,
    count: int,
    result: FloquetResult | None = None,
    samples: int = COARSE,
    coordinates: int | None = None,
) -> SlowMotions:
    """Find the `count` slowest real motions of a system of second order; a complex pair gives two of them.

    Each mode is turned in the complex plane so that its largest deflection at t = 0 is real: one motion starts from there, the other
    swings through. Modes that decay too fast to be resolved are left out.

    Parameters: result: the exponents, if they are known; samples: times of a period, at the least; coordinates: how many of the
    states are deflections, the first half by default.
    Raises: what `floquet` raises; TooLarge when the resolution that a fast mode asks for makes too many transition matrices;
    NumericalError when no mode is resolved.
    """
    result = result or floquet(system, TOLERANCE)
    seen = np.isfinite(result.errors) & (result.exponents.real * system.period > -samples * GONE)
    slow = np.flatnonzero((result.exponents.imag >= 0) & seen)[: max(1, count)]
    if not len(slow):
        raise no_motion(result)
    t, modes = right_modes(system, result, slow, samples)
    n = coordinates or system.n // 2
    found = [
        motion for i, mode in zip(slow, modes, strict=True) for motion in real_motions(t, mode, result.exponents[i], n)
    ]
    states = np.array(found[: max(1, count)])
    states /= np.abs(states[:, :, :n]).max(axis=(1, 2))[:, None, None]
    return SlowMotions(states[:, 0], t, states)


def right_modes(system: PeriodicSystem, result: FloquetResult, which: Array, samples: int) -> tuple[Array, Array]:
    """Times (N,), both ends of the period included, and periodic right eigenvectors (k, N, n) of some exponents.

    p_(j+1) = exp(-lambda h_j) Phi_j p_j,   p_N = p_0:   the null vector of a cyclic system, or from the decoupled one
    """
    n, setting, decoupled = system.n, result.setting, result.decoupled
    if decoupled is not None and len(decoupled.times) >= samples:
        both = solve_decoupled_modes(decoupled, result.exponents)
        if both is not None:
            modes = np.moveaxis(both[0][:, :, which], -1, 0)
            return np.append(decoupled.times, system.period), np.concatenate([modes, modes[:, :1]], axis=1)
    if setting.method not in METHODS:
        setting = choose_setting(system, SLOW_TOL, "radau", None, None)
    setting = setting.with_segments(max(samples, setting.segments))
    grid = place_segments(system, setting)
    check_size(
        "a mode's system",
        (8 + 64 * len(which)) * len(grid) * n * n,
        f"the modes need {len(grid)} transition matrices of order {n}: leave out the fastest modes, or lower the gains behind them",
    )
    Phi, scale = balance_factors(factor_by(system, grid, setting.method, setting.order))
    ranks = np.tril(find_coinciding(result.log_multipliers), -1).sum(axis=1)[which]
    together = max(1, len(Phi) // GROUPS)
    found, _ = periodic_vectors(Phi, grid, result.exponents[which], ranks, together)
    modes = np.moveaxis(found * scale[:, None], -1, 0)
    return grid, np.concatenate([modes, modes[:, :1]], axis=1)


def real_motions(t: Array, mode: Array, exponent: complex, n: int) -> list[Array]:
    """The real motion of a real mode, the two of a complex one, at times t with t[0] = 0: (N, 2n) each."""
    largest = mode[0, np.argmax(np.abs(mode[0, :n]))]
    motion = mode * (abs(largest) / largest) * np.exp(exponent * t)[:, None]
    parts = [motion.real, motion.imag]
    return parts if np.abs(motion[0].imag).max() > REAL * np.abs(motion[0].real).max() else parts[:1]


JUST_BEFORE = 1e-9
"""Of a period: where the coefficients are read just before they jump."""


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
        return float(np.abs(self(np.linspace(low, high, SAMPLES + 1))[0]).max())

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
