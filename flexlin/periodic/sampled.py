"""A periodic system under a held input: its exact discrete-time model, delay included, and Floquet's verdict over whole rounds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, counted
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficients import Combined, MatrixFunction, as_matrix_function, check_samples, hold_input
from flexlin.periodic.floquet.by_segments import METHOD_SAFETY
from flexlin.periodic.floquet.result import FloquetResult, judge
from flexlin.periodic.product import find_spectrum
from flexlin.periodic.response.forced import STEP_STAGES
from flexlin.periodic.response.transient import divide_times
from flexlin.periodic.system import PeriodicSystem, input_of
from flexlin.periodic.transition.choose_segments import Setting
from flexlin.periodic.transition.factors import gauss_transitions
from flexlin.precision import EPS, SAFETY, SLIGHT

ROUND_SAMPLES = 1024
"""Samples of a round, unless a single period takes more."""
EXACT_SHARE = ROUND_SAMPLES * EPS
"""Relative distance at which a sampling time counts as a whole part of whole periods."""


@dataclass(frozen=True)
class Round:
    """`samples` N of the sampling time fill `periods` q of a period T, N h = q T, up to the relative distance `off` of q T / N from h."""

    period: float
    samples: int
    periods: int
    off: float = 0.0

    def __str__(self) -> str:
        return f"{counted(self.samples, 'sample')} in {counted(self.periods, 'period')}"

    @property
    def time(self) -> float:
        """q T."""
        return self.periods * self.period

    @property
    def step(self) -> float:
        """h."""
        return self.time / self.samples

    @property
    def instants(self) -> Array:
        """The times k h (N,)."""
        return self.time * np.arange(self.samples) / self.samples

    def divide(self, delay: float) -> tuple[Array, Array, Array]:
        """Beginning and end (N,) of the samples, and between them when their inputs take effect; delay as a part of one, in [0, 1]."""
        t = self.instants
        return t, t + delay * self.step, t + self.step


@dataclass(frozen=True, eq=False)
class HeldPlant:
    """z_(k+1) = F_k z_k + G_k u_k at the samples of a round, with z = x, or z = [x; u_(k-1)] where the input comes late.

    F (N, r, r), G (N, r, m).
    """

    F: Array
    G: Array
    turn: Round

    def closed_by(self, gain: MatrixFunction) -> Array:
        """F_k - G_k [K_k, 0] with gains K (N, m, n) at the instants, or (N, m, r) of all that is known there."""
        loop, K = self.F.copy(), gain(np.mod(self.turn.instants, self.turn.period))
        loop[:, :, : K.shape[2]] -= self.G @ K
        return loop


def hold_plant(system: PeriodicSystem, turn: Round, delay: float, tol: float, stages: int = STEP_STAGES) -> HeldPlant:
    """Discretize x' = A x + B u over the samples of a round; delay as a part of one, in [0, 1].

    x(t_(k+1)) = P1 (P0 x_k + G0 u_(k-1)) + G1 u_k,    0: from t_k to t_k + delay,  1: from there to t_(k+1)
    """
    input_of(system)
    begin, effect, end = turn.divide(delay)
    before = sections(system, begin, effect, tol, stages) if delay else None
    return HeldPlant(*step_inputs(before, sections(system, effect, end, tol, stages), system.n), turn)


def step_inputs(before: Array | None, behind: Array, n: int) -> tuple[Array, Array]:
    """F and G from the transition matrices (N, n + m, n + m) before an input changes and behind that, without a state for the one that was
    held where none comes late."""
    if before is None:
        return behind[:, :n, :n], behind[:, :n, n:]
    F, G = np.zeros_like(behind), np.zeros_like(behind[:, :, n:])
    F[:, :n] = behind[:, :n, :n] @ before[:, :n]
    G[:, :n], G[:, n:] = behind[:, :n, n:], np.eye(behind.shape[1] - n)
    return F, G


def hold_controller(rates: Array, step: float) -> Array:
    """The integral (k, k) of exp(F s) over one step, for z' = rates [x; z] with F the last k columns.

    Under inputs that are held, z moves by this times its rate at the beginning of the step.
    """
    k = len(rates)
    block = np.zeros((2 * k, 2 * k))
    block[:k, :k], block[:k, k:] = rates[:, -k:], np.eye(k)
    with np.errstate(over="ignore", invalid="ignore"):  # of a controller that grows beyond numbers
        return np.asarray(expm(step * block)[:k, k:])


def with_controller_states(plant: HeldPlant, rates: Array) -> HeldPlant:
    """The plant with a controller's states z behind its own, z_(k+1) = z_k + held rates [x_k; z_k]; rates (k, n + k)."""
    k, (count, size) = len(rates), plant.F.shape[:2]
    n = rates.shape[1] - k
    moved = hold_controller(rates, plant.turn.step) @ rates
    moved[:, n:] += np.eye(k)
    F, G = np.zeros((count, size + k, size + k)), np.zeros((count, size + k, plant.G.shape[2]))
    of_plant = np.r_[:n, n + k : size + k]
    F[:, of_plant[:, None], of_plant], G[:, of_plant] = plant.F, plant.G
    F[:, n : n + k, : n + k] = moved
    return HeldPlant(F, G, plant.turn)


def sections(system: PeriodicSystem, begin: Array, end: Array, tol: float, stages: int) -> Array:
    """Transition matrices (N, n + m, n + m) of the augmented system from begin (N,) to end (N,)."""
    held = Combined(hold_input, (system.resolved, system.resolved_input))
    steps = gauss_transitions(held, divide_sections(system, begin, end, tol), stages)
    return reduce(lambda whole, step: step @ whole, np.swapaxes(steps, 0, 1))


def divide_sections(
    system: PeriodicSystem, begin: Array, end: Array, tol: float, others: Sequence[ResolvedMatrix] = ()
) -> Array:
    """Edges (N, c + 1) of steps inside sections, as of `divide_times`; the last of those that have fewer are repeated."""
    edges = divide_times(system, np.union1d(begin, end), tol, others)
    first, last = np.searchsorted(edges, begin), np.searchsorted(edges, end)
    count = max(1, int((last - first).max()))
    return np.asarray(edges[np.minimum(first[:, None] + np.arange(count + 1), last[:, None])])


def find_rounds(period: float, sample_time: float) -> tuple[Round, ...]:
    """One exact round, or the nearest below and above with at most ROUND_SAMPLES samples, the nearer one first.

    Source: the Stern-Brocot tree, Graham, Knuth, Patashnik, Concrete Mathematics (1994), section 4.5.
    """
    ratio = sample_time / period
    most = max(ROUND_SAMPLES, int(2 / ratio) + 1)
    below, above = (int(ratio), 1), (int(ratio) + 1, 1)
    while True:
        for periods, samples in (below, above):
            if abs(periods / (ratio * samples) - 1) <= EXACT_SHARE:
                return (Round(period, samples, periods),)
        middle = below[0] + above[0], below[1] + above[1]
        if middle[1] > most:
            break
        below, above = (middle, above) if middle[0] <= ratio * middle[1] else (below, middle)
    pairs = [(periods, samples) for periods, samples in (below, above) if periods > 0]
    rounds = [Round(period, samples, periods, abs(periods / (ratio * samples) - 1)) for periods, samples in pairs]
    return tuple(sorted(rounds, key=lambda turn: turn.off))


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

    def close(turn: Round, stages: int) -> Array:
        """The steps (N, r, r) of the loop over a round."""
        plant = hold_plant(system, turn, delay / h, tol, stages)
        return (plant if own is None else with_controller_states(plant, own)).closed_by(K)

    return judge_samples(close, find_rounds(system.period, h), tol)


def judge_samples(close: Callable[[Round, int], Array], rounds: Sequence[Round], tol: float) -> FloquetResult:
    """The verdict on the steps (N, r, r) of a loop, from a round and the stages of a step, over the first of rounds.

    Where that is not exact, the distance to the growth over another counts as error.
    """
    found = [solve_round(close(turn, STEP_STAGES), close(turn, STEP_STAGES + 2), turn) for turn in rounds]
    best, (exponents, errors), reason = rounds[0], found[0], str(rounds[0])
    for other, _ in found[1:]:
        errors = errors + METHOD_SAFETY * abs(other[0].real - exponents[0].real)
        reason += f", {best.off:.0e} beside the sampling time"
    return judge(exponents, errors, best.time, Setting("sampled", 0, best.samples, reason), tol)


def solve_round(loops: Array, better: Array, turn: Round) -> tuple[Array, Array]:
    """Exponents (r,), by falling real part, of the product of a round's steps (N, r, r), and errors, inf where unresolved.

    A step is a product and a difference itself, and carries some roundings of its size.
    Parameters: better: the same steps by two more stages.
    """
    found = find_spectrum(loops, better, part=True)
    errors = METHOD_SAFETY * found.method + SAFETY * found.rounding
    below = found.logs.real[0] - found.logs.real
    hidden = (errors > SLIGHT * below) & (below > max(1.0, errors[0]))
    return found.logs / turn.time, np.where(np.logical_or.accumulate(hidden), np.inf, errors) / turn.time
