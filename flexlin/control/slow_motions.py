"""The linear motions that decay slowest, from Floquet modes: nothing is multiplied out over a period."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BPoly, PPoly

from flexlin.checks import SUM_ROUNDING, Array, check_size
from flexlin.errors import NumericalError
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.product import periodic_vectors
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import METHODS, choose_setting, factor_period, place_segments

SLOW_TOL = 1e-6
"""Accuracy that is enough for a direction: of the exponents, in 1/s, of the segments where the exponents came without any (an L-stable
method damps what is fast), and of an imaginary part against the real one, below which it belongs to a real mode."""
GONE_DECAY = 200.0
"""A mode that decays by exp(-GONE_DECAY) from one sample to the next has no motion to show."""
COARSE_TIMES = 64
"""Times of a period at which a motion is given, at the least, where a direction is all that is asked for; into so many products the
transition matrices of a period are multiplied, too: over so small a part of it the slowest modes part by little."""


@dataclass(frozen=True)
class SlowMotions:
    """Real motions x(t) = Re p(t) exp(lambda t) and Im p(t) exp(lambda t) of the slowest modes.

    Each is scaled to a largest deflection of 1 (rad or m) over a period.
    t (N,): times in [0, T]; states (k, N, 2n): x(t).
    """

    t: Array
    states: Array

    @property
    def directions(self) -> Array:
        """x(0), (k, 2n)."""
        return self.states[:, 0]

    def thinned(self) -> "SlowMotions":
        """The same at every second time, and at the last."""
        kept = np.union1d(np.arange(0, len(self.t), 2), len(self.t) - 1)
        return SlowMotions(self.t[kept], self.states[:, kept])


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
    samples: int = COARSE_TIMES,
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
    result = result or floquet(system, SLOW_TOL)
    seen = np.isfinite(result.errors) & (result.exponents.real * system.period > -samples * GONE_DECAY)
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
    return SlowMotions(t, states)


def right_modes(system: PeriodicSystem, result: FloquetResult, which: Array, samples: int) -> tuple[Array, Array]:
    """Times (N,), both ends of the period included, and periodic right eigenvectors (k, N, n) of some exponents.

    p_(j+1) = exp(-lambda h_j) Phi_j p_j,   p_N = p_0:   as `periodic_vectors`
    """
    n, setting = system.n, result.setting
    if setting.method not in METHODS:
        setting = choose_setting(system, SLOW_TOL, "radau")
    setting = replace(setting, segments=max(samples, setting.segments))
    grid = place_segments(system, setting)
    check_size(
        "a mode's system",
        96 * len(grid) * n * n,
        f"the modes need {len(grid)} transition matrices of order {n}: leave out the fastest modes, or lower the gains behind them",
    )
    found = periodic_vectors(factor_period(system, setting), grid, result.exponents)[0]
    modes = np.moveaxis(found[:, :, which], -1, 0)
    return grid, np.concatenate([modes, modes[:, :1]], axis=1)


def real_motions(t: Array, mode: Array, exponent: complex, n: int) -> list[Array]:
    """The real motion of a real mode, the two of a complex one, at times t with t[0] = 0: (N, 2n) each, of any size at the largest."""
    largest = mode[0, np.argmax(np.abs(mode[0, :n]))]
    turned = mode * (abs(largest) / largest)
    motion = turned * np.exp(exponent * t - max(exponent.real, 0.0) * t[-1])[:, None]
    parts = [motion.real, motion.imag]
    return parts if np.abs(turned[0].imag).max() > SLOW_TOL * np.abs(turned[0].real).max() else parts[:1]


def interpolate(system: PeriodicSystem, n: int, slow: SlowMotions) -> list[PPoly]:
    """The deflections y(t) of each motion in [0, T], of degree five between its times: y, y' and y'' are met at both ends.

    y'' may jump where the coefficients do. The first n states are the deflections, the next n their rates.
    """
    t, x = slow.t, slow.states
    after, before = (
        np.einsum("tij,ktj->kti", system.resolved(at), states)[:, :, n : 2 * n]
        for at, states in ((t[:-1], x[:, :-1]), (t[1:] * (1 - SUM_ROUNDING), x[:, 1:]))
    )
    h = np.diff(t)[:, None]
    (y, rate), (end, end_rate) = ((part[:, :, :n], part[:, :, n : 2 * n]) for part in (x[:, :-1], x[:, 1:]))
    leaving = y, y + h * rate / 5, y + 2 * h * rate / 5 + h**2 * after / 20
    arriving = end - 2 * h * end_rate / 5 + h**2 * before / 20, end - h * end_rate / 5, end
    c = np.array([*leaving, *arriving])  # Bernstein's
    return [PPoly.from_bernstein_basis(BPoly(c[:, k], t)) for k in range(len(x))]
