"""Floquet's verdict on a loop whose gain is sampled and held, with a delay: exact for the held input, over whole rounds of samples."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, counted
from flexlin.periodic.coefficients import MatrixFunction, as_matrix_function, check_samples
from flexlin.periodic.floquet.result import FloquetResult, judge
from flexlin.periodic.floquet.segmented import SAFETY
from flexlin.periodic.precision import EPS, SLIGHT
from flexlin.periodic.product.spectrum import find_spectrum
from flexlin.periodic.sampled.hold import STAGES, hold_plant, with_controller_states
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import Setting

MOST = 1024
"""Samples of a round, unless a single period takes more."""
EXACT = MOST * EPS
"""Relative distance at which a sampling time counts as a whole part of whole periods."""


@dataclass(frozen=True)
class Round:
    """`samples` N of the sampling time fill `periods` q periods, N h = q T, up to the relative distance `off` of q T / N from h."""

    samples: int
    periods: int
    off: float


def find_rounds(period: float, sample_time: float) -> tuple[Round, ...]:
    """One exact round, or the nearest below and above with at most MOST samples, the nearer one first.

    Source: the Stern-Brocot tree, Graham, Knuth, Patashnik, Concrete Mathematics (1994), section 4.5.
    """
    ratio = sample_time / period
    most = max(MOST, int(2 / ratio) + 1)
    below, above = (int(ratio), 1), (int(ratio) + 1, 1)
    while True:
        for periods, samples in (below, above):
            if abs(periods / (ratio * samples) - 1) <= EXACT:
                return (Round(samples, periods, 0.0),)
        middle = below[0] + above[0], below[1] + above[1]
        if middle[1] > most:
            break
        below, above = (middle, above) if middle[0] <= ratio * middle[1] else (below, middle)
    rounds = [Round(samples, periods, abs(periods / (ratio * samples) - 1)) for periods, samples in (below, above)]
    return tuple(sorted((turn for turn in rounds if turn.periods > 0), key=lambda turn: turn.off))


@checked
def sampled_floquet(
    system: PeriodicSystem,
    gain: MatrixFunction | ArrayLike,
    sample_time: float,
    delay: float = 0.0,
    tol: float = 1e-9,
    rates: ArrayLike | None = None,
) -> FloquetResult:
    """Compute the Floquet exponents of the loop u(t) = -K(t_k) x(t_k) for t_k + delay <= t < t_(k+1) + delay, t_k = k h.

        z_(k+1) = (F_k - G_k [K(t_k), 0]) z_k,    z = [x; u_(k-1)],    growth = log of the product's multipliers / time

    F and G are exact for the held input. Where N samples fill q periods the product over them is periodic and the exponents are
    exact. Other sampling times lie between two that do so; the nearer one gives the exponents, their distance counts as error.

    Parameters
    ----------
    system : PeriodicSystem
        The plant without feedback, with n states and m inputs.
    gain : array_like (m, n + k), or function of times (N,) -> (N, m, n + k)
        K, read at the instants only; of a late loop (m, n + k + m) where it feeds back the input that is held then, too.
    sample_time : float
        h, in s.
    delay : float
        Time from measuring to the torque taking effect, 0 to h, in s.
    tol : float
        Wanted error of the exponents, in 1/s, relative beyond 1/s.
    rates : array_like (k, n + k), optional
        Of a controller with k states, z' = rates [x; z] and u = -K [x; z]: it moves from sample to sample, with x as it was sampled.

    Returns
    -------
    FloquetResult
        With `setting.method` "sampled"; its period is that of q motions. A mode without memory has no resolved exponent.

    Raises
    ------
    ArgumentError
        When the gain does not fit, or the delay is longer than the sampling time.
    TooManySegments
        When the loop would take too many steps.

    References
    ----------
    Chen, Francis, Optimal Sampled-Data Control Systems (1995), ch. 3 and 8; Bittanti, Colaneri, Periodic Systems (2009), ch. 6.

    Examples
    --------
    x' = u under u = -2 x(t_k) is stable for h < 1:

    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0]], 1.0, B=[[1.0]])
    >>> [fl.control.sampled_floquet(system, [[2.0]], h).verdict for h in (0.9, 1.1)]
    ['stable', 'unstable']
    """
    h, tol = positive("sample_time", sample_time), positive("tol", tol)
    if not 0 <= delay <= h:
        raise ArgumentError("the delay is out of range", got=delay, expected=f"0 to the sampling time, {h:g} s")
    K = as_matrix_function("gain", gain)
    own = None if rates is None else real_array("rates", rates, (None, None))
    got, states = check_samples("gain", K, system.period).shape[1:], system.n + (0 if own is None else len(own))
    if got != (system.m, states) and not (delay and got == (system.m, states + system.m)):
        raise ArgumentError("the gain does not fit the system", got=got, expected=f"({system.m}, {states})")
    if own is not None and own.shape[1] != states:
        raise ArgumentError("the rates do not fit the system", got=own.shape, expected=f"({len(own)}, {states})")
    best, *others = find_rounds(system.period, h)
    time = best.periods * system.period
    exponents, errors = (part / time for part in solve_round(system, K, best, delay / h, tol, own))
    reason = f"{counted(best.samples, 'sample')} in {counted(best.periods, 'period')}"
    for other in others:
        logs, _ = solve_round(system, K, other, delay / h, tol, own)
        errors = errors + SAFETY * abs(logs[0].real / (other.periods * system.period) - exponents[0].real)
        reason += f", {best.off:.0e} beside the sampling time"
    return judge(exponents, errors, time, Setting("sampled", 0, best.samples, reason), tol)


def solve_round(
    system: PeriodicSystem, K: MatrixFunction, turn: Round, delay: float, tol: float, rates: Array | None
) -> tuple[Array, Array]:
    """The logs of the loop's multipliers over one round, as of `solve_loops`; delay as a part of the sampling time."""
    loops, step = [], turn.periods * system.period / turn.samples
    for stages in (STAGES, STAGES + 2):
        plant = hold_plant(system, turn.samples, turn.periods, delay, tol, stages)
        plant = plant if rates is None else with_controller_states(plant, rates, step)
        loops.append(plant.closed_by(K(np.mod(plant.instants, system.period))))
    return solve_loops(*loops)


def solve_loops(loops: Array, better: Array) -> tuple[Array, Array]:
    """Logs (r,), by falling real part, of the multipliers of the product of a round's steps (N, r, r), and errors, inf where unresolved.

    Parameters: better: the same steps by two more stages.
    """
    found = find_spectrum(loops, better)
    errors = SAFETY * found.method + found.rounding
    below = found.logs.real[0] - found.logs.real
    return found.logs, np.where((errors > SLIGHT * below) & (below > errors[0]), np.inf, errors)


def judge_samples(loops: Array, better: Array, turn: Round, period: float, tol: float) -> FloquetResult:
    """The verdict on the steps (N, r, r) of a round that is exact."""
    (logs, errors), time = solve_loops(loops, better), turn.periods * period
    setting = Setting(
        "sampled", 0, turn.samples, f"{counted(turn.samples, 'sample')} in {counted(turn.periods, 'period')}"
    )
    return judge(logs / time, errors / time, time, setting, tol)
