"""A periodic system under a held input: its exact discrete-time model, delay included, and Floquet's verdict over whole rounds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, TooManySegments, counted
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.coefficients import Combined, MatrixFunction, as_matrix_function, check_samples, hold_input
from flexlin.periodic.floquet.by_segments import METHOD_SAFETY
from flexlin.periodic.floquet.result import FloquetResult, judge
from flexlin.periodic.interpolation import NODES, divide_segments, edges_of_short
from flexlin.periodic.product import find_spectrum
from flexlin.periodic.response.forced import STEP_STAGES
from flexlin.periodic.system import PeriodicSystem, input_of
from flexlin.periodic.transition.choose_segments import MAX_SEGMENTS, Setting, choose_gauss_step, measure_pace
from flexlin.periodic.transition.factors import gauss_transitions
from flexlin.precision import EPS, SAFETY, SLIGHT

PANEL_STEPS = NODES // STEP_STAGES
"""Steps, at the least, over a panel of the coefficients: it may hold more waves than the stages of one follow."""
MOST_STEPS = NODES * MAX_SEGMENTS
ROUND_SAMPLES = 1024
"""Samples of a round, unless a single period takes more."""
EXACT_SHARE = ROUND_SAMPLES * EPS
"""Relative distance at which a sampling time counts as a whole part of whole periods."""


@dataclass(frozen=True, eq=False)
class HeldPlant:
    """z_(k+1) = F_k z_k + G_k u_k at the instants t_k = k h, with z = x, or z = [x; u_(k-1)] where the input comes late.

    F (N, r, r), G (N, r, m), instants (N,) in s; states n of x, inputs m.
    """

    F: Array
    G: Array
    instants: Array
    states: int
    inputs: int

    def closed_by(self, K: Array) -> Array:
        """F_k - G_k [K_k, 0] with gains K (N, m, n) at the instants, or (N, m, r) of all that is known there."""
        loop = self.F.copy()
        loop[:, :, : K.shape[2]] -= self.G @ K
        return loop


def hold_plant(
    system: PeriodicSystem, samples: int, periods: int, delay: float, tol: float, stages: int = STEP_STAGES
) -> HeldPlant:
    """Discretize x' = A x + B u over `samples` equal intervals of `periods` periods; delay as a part of one interval, in [0, 1].

    x(t_(k+1)) = P1 (P0 x_k + G0 u_(k-1)) + G1 u_k,    0: from t_k to t_k + delay,  1: from there to t_(k+1)
    """
    input_of(system)
    n, m, T = system.n, system.m, system.period
    h = T * periods / samples
    t = T * periods * np.arange(samples) / samples
    P0, P1 = (sections(system, *ends, tol, stages) for ends in ((t, t + delay * h), (t + delay * h, t + h)))
    return HeldPlant(*step_inputs(P0, P1, n, delay), t, n, m)


def step_inputs(P0: Array, P1: Array, n: int, delay: float) -> tuple[Array, Array]:
    """F and G from the transition matrices (N, n + m, n + m) before an input changes and behind that, without a state for the one that was
    held where none comes late."""
    if not delay:
        return P1[:, :n, :n], P1[:, :n, n:]
    F, G = np.zeros_like(P1), np.zeros_like(P1[:, :, n:])
    F[:, :n] = P1[:, :n, :n] @ P0[:, :n]
    G[:, :n], G[:, n:] = P1[:, :n, n:], np.eye(P1.shape[1] - n)
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


def with_controller_states(plant: HeldPlant, rates: Array, step: float) -> HeldPlant:
    """The plant with a controller's states z behind its own, z_(k+1) = z_k + held rates [x_k; z_k]: they count as states of it."""
    n, k, (count, size) = plant.states, len(rates), plant.F.shape[:2]
    moved = hold_controller(rates, step) @ rates
    moved[:, n:] += np.eye(k)
    F, G = np.zeros((count, size + k, size + k)), np.zeros((count, size + k, plant.inputs))
    of_plant = np.r_[:n, n + k : size + k]
    F[:, of_plant[:, None], of_plant], G[:, of_plant] = plant.F, plant.G
    F[:, n : n + k, : n + k] = moved
    return HeldPlant(F, G, plant.instants, n + k, plant.inputs)


def sections(system: PeriodicSystem, begin: Array, end: Array, tol: float, stages: int) -> Array:
    """Transition matrices (N, n + m, n + m) of the augmented system from begin (N,) to end (N,), all of one length."""
    if not np.any(end > begin):
        return np.broadcast_to(np.eye(system.n + system.m), (len(begin), *2 * [system.n + system.m]))
    held = Combined(hold_input, (system.resolved, system.resolved_input))
    parts = step_sections(held, divide(system, begin, end, tol), stages)
    whole = parts[:, 0]
    for k in range(1, parts.shape[1]):
        whole = parts[:, k] @ whole
    return whole


def step_sections(A: MatrixFunction, edges: Array, stages: int) -> Array:
    """Transition matrices (N, c, s, s) of x' = A x over all steps between edges (N, c + 1)."""
    count = edges.shape[1] - 1
    together = np.concatenate([edges[:, :-1].ravel(), edges[-1:, -1]])
    if np.all(edges[1:, 0] == edges[:-1, -1]):
        steps = gauss_transitions(A, together, stages)
    else:  # gaps between the sections are integrated too and left out
        flat = gauss_transitions(A, edges.ravel(), stages)
        keep = np.arange(len(edges) * (count + 1) - 1) % (count + 1) != count
        steps = flat[keep]
    return steps.reshape(len(edges), count, *steps.shape[1:])


def divide(
    system: PeriodicSystem, begin: Array, end: Array, tol: float, others: Sequence[ResolvedMatrix] = ()
) -> Array:
    """Edges (N, c + 1) of steps inside sections, short enough for tol; none passes over a corner or a part of a panel of A, B or others."""
    T = system.period
    longest = float(choose_gauss_step(measure_pace(system).rate.max(keepdims=True), tol, STEP_STAGES).min())
    width = float((end - begin).max())
    count = max(1, int(np.ceil(width / longest)))
    if count * len(begin) > MOST_STEPS:
        raise TooManySegments(
            "the sampled loop takes too many steps", got=count * len(begin), expected=f"at most {MOST_STEPS}"
        )
    edges = begin[:, None] + (end - begin)[:, None] * np.arange(count + 1) / count
    resolved = (system.resolved, system.resolved_input, *others)
    panels = (divide_segments(one.edges, PANEL_STEPS) for one in resolved if one.panels > 1)
    short = [np.mod(edges_of_short(edges, width / count), T) for edges in panels]
    corners = np.unique(np.concatenate([*short, *(one.breaks for one in resolved)]))
    if len(corners):
        turns = np.floor((begin[:, None] - corners) / T) + 1
        inner = np.clip(corners + turns * T, begin[:, None], end[:, None])
        edges = np.sort(np.concatenate([edges, inner], axis=1), axis=1)
    edges[:, 0], edges[:, -1] = begin, end
    return edges


@dataclass(frozen=True)
class Round:
    """`samples` N of the sampling time fill `periods` q periods, N h = q T, up to the relative distance `off` of q T / N from h."""

    samples: int
    periods: int
    off: float

    def __str__(self) -> str:
        return f"{counted(self.samples, 'sample')} in {counted(self.periods, 'period')}"


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
    reason = str(best)
    for other in others:
        logs, _ = solve_round(system, K, other, delay / h, tol, own)
        errors = errors + METHOD_SAFETY * abs(logs[0].real / (other.periods * system.period) - exponents[0].real)
        reason += f", {best.off:.0e} beside the sampling time"
    return judge(exponents, errors, time, Setting("sampled", 0, best.samples, reason), tol)


def solve_round(
    system: PeriodicSystem, K: MatrixFunction, turn: Round, delay: float, tol: float, rates: Array | None
) -> tuple[Array, Array]:
    """The logs of the loop's multipliers over one round, as of `solve_loops`; delay as a part of the sampling time."""
    loops, step = [], turn.periods * system.period / turn.samples
    for stages in (STEP_STAGES, STEP_STAGES + 2):
        plant = hold_plant(system, turn.samples, turn.periods, delay, tol, stages)
        plant = plant if rates is None else with_controller_states(plant, rates, step)
        loops.append(plant.closed_by(K(np.mod(plant.instants, system.period))))
    return solve_loops(*loops)


def solve_loops(loops: Array, better: Array) -> tuple[Array, Array]:
    """Logs (r,), by falling real part, of the multipliers of the product of a round's steps (N, r, r), and errors, inf where unresolved.

    A step is a product and a difference itself, and carries some roundings of its size.
    Parameters: better: the same steps by two more stages.
    """
    found = find_spectrum(loops, better, part=True)
    errors = METHOD_SAFETY * found.method + SAFETY * found.rounding
    below = found.logs.real[0] - found.logs.real
    hidden = (errors > SLIGHT * below) & (below > max(1.0, errors[0]))
    return found.logs, np.where(np.logical_or.accumulate(hidden), np.inf, errors)


def judge_samples(loops: Array, better: Array, turn: Round, period: float, tol: float) -> FloquetResult:
    """The verdict on the steps (N, r, r) of a round that is exact."""
    (logs, errors), time = solve_loops(loops, better), turn.periods * period
    return judge(logs / time, errors / time, time, Setting("sampled", 0, turn.samples, str(turn)), tol)
