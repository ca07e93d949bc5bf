"""The linear motions that decay slowest, from Floquet modes: nothing is multiplied out over a period."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import NumericalError
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.system import PeriodicSystem

TOLERANCE = 1e-6
"""Error of the exponents, in 1/s, that is enough for a direction."""
REAL = 1e-6
"""An imaginary part this small against the real one belongs to a real mode."""


@dataclass(frozen=True)
class SlowMotions:
    """Real motions x(t) = Re p(t) exp(lambda t) and Im p(t) exp(lambda t) of the slowest modes.

    directions (k, 2n): x(0), each with a largest deflection of 1; t (N,): times in [0, T); states (k, N, 2n): x(t).
    """

    directions: Array
    t: Array
    states: Array


def slow_motions(system: PeriodicSystem, count: int, result: FloquetResult | None = None) -> SlowMotions:
    """Find the `count` slowest real motions of a system of second order; a complex pair gives two of them.

    Each mode is turned in the complex plane so that its largest number at t = 0 is real. Modes that decay too fast to be resolved are
    left out.

    Parameters: result: the exponents, if they are known.
    Raises: what `floquet` raises; TooLarge when the resolution that a fast mode asks for makes too many transition matrices;
    NumericalError when no mode is resolved.
    """
    result = result or floquet(system, TOLERANCE)
    n, setting = system.n, result.setting
    nodes = (setting.order if setting.method == "hill" else setting.segments) * (1 + max(6, setting.order // 2))
    check_size(
        "the Floquet modes",
        8 * nodes * n * n * 16,
        f"the modes need {nodes} transition matrices of order {n}: leave out the fastest modes, or lower the gains that make them fast",
    )
    modes = floquet_modes(system, result)
    found: list[Array] = []
    for i in np.flatnonzero((modes.exponents.imag >= 0) & np.isfinite(modes.errors)):
        if len(found) >= max(1, count):
            break
        found += real_motions(modes.times, modes.right[:, :, i], modes.exponents[i])
    if not found:
        raise NumericalError(
            "no Floquet mode is resolved", todo="ask for a smaller tol, or look at the Floquet verdict"
        )
    states = np.array(found[: max(1, count)])
    states /= np.abs(states[:, 0, : n // 2]).max(axis=1)[:, None, None]
    return SlowMotions(states[:, 0], modes.times, states)


def real_motions(t: Array, mode: Array, exponent: complex) -> list[Array]:
    """The real motion of a real mode, the two of a complex one, at times t with t[0] = 0: (N, 2n) each."""
    largest = mode[0, np.argmax(np.abs(mode[0]))]
    motion = mode * (abs(largest) / largest) * np.exp(exponent * t)[:, None]
    parts = [motion.real, motion.imag]
    return parts if np.abs(motion[0].imag).max() > REAL * np.abs(motion[0].real).max() else parts[:1]
