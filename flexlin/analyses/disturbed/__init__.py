"""The answer of a loop to a disturbance at every phase of the period, by the nonlinear equations at the worst one, and to noise."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from flexlin.analyses.analysis import derive_equations
from flexlin.analyses.clock import Clock
from flexlin.analyses.disturbed.stated import Directions, Disturbance, Kind, disturb, state_disturbance
from flexlin.analyses.judging import LEAST_TOL
from flexlin.analyses.loops import find_design
from flexlin.checks import SAMPLES, Array, check_size, positive
from flexlin.control.catalogue import design
from flexlin.control.drives import DriveLoad, drive_load
from flexlin.errors import ArgumentError, NumericalError
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficients import MatrixFunction, combine
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.response.forced import forced_response
from flexlin.periodic.riccati.riccati import periodic_lyapunov
from flexlin.periodic.sampled import STEP_STAGES, sections
from flexlin.periodic.system import Backward, PeriodicSystem, dual_system, of_plant
from flexlin.precision import SLIGHT
from flexlin.scene.control import Drives
from flexlin.scene.scene import Scene
from flexlin.simulation.drive import Drive, scene_drive
from flexlin.simulation.equations import NonlinearEquations, Places
from flexlin.simulation.loop import NonlinearLoop
from flexlin.summary import immutable

PHASES = np.arange(16) / 16
"""At which the disturbance begins."""
TIMES_IN_PUSH = 8
"""Times at which a push is looked at while it lasts."""
SETTLING_BAND = 0.02
"""The answer has settled when it stays within this part of its largest size."""


def answer_linearly(
    loop: PeriodicSystem, enters: MatrixFunction, start: Array, stated: Disturbance, count: int, tol: float
) -> tuple[Array, Array]:
    """Follow x' = A x + enters(t) u from x = start, u its size as long as a push lasts, else for ever, over `count` steps of T / SAMPLES.

    Returns: times t (S,) in s after the beginning, and deviations from the steady motion (P, S, n) for each of PHASES.
    """
    T, n, duration = loop.period, loop.n, stated.time if stated.kind == "push" else 0.0
    driven = PeriodicSystem(loop.A, T, enters, loop.breaks, loop.second_order, loop.features, loop.complete)
    z = np.empty((len(PHASES), n + 1))
    z[:, :n], z[:, n] = start, stated.size
    kept, t = [z[:, :n].copy()], [0.0]

    def go(transition: Array, time: float) -> None:
        z[:] = np.einsum("pij,pj->pi", transition, z)
        kept.append(z[:, :n].copy())
        t.append(time)

    if duration:
        length = duration / TIMES_IN_PUSH
        edges = (PHASES[:, None] * T + length * np.arange(TIMES_IN_PUSH)).ravel()
        inside = sections(driven, edges, edges + length, tol, STEP_STAGES)
        for k, transition in enumerate(inside.reshape(len(PHASES), TIMES_IN_PUSH, n + 1, n + 1).swapaxes(0, 1)):
            go(transition, duration * (k + 1) / TIMES_IN_PUSH)
        z[:, n] = 0.0
    grid = duration + T * np.arange(SAMPLES) / SAMPLES
    steps, place = sections(driven, grid, grid + T / SAMPLES, tol, STEP_STAGES), (SAMPLES * PHASES).astype(int)
    for k in range(count):
        go(steps[(place + k) % SAMPLES], duration + T * (k + 1) / SAMPLES)
    return np.array(t), np.stack(kept, axis=1)


class PushedEquations(NonlinearEquations):
    """The nonlinear equations with a force `size` at the tip, in N, whose power is not counted."""

    def __init__(self, lin: Linearization, law: Law, directions: Directions, size: float):
        super().__init__(lin, law)
        self._directions, self._size = directions, size

    def of_arm(self, at: Places, y: Array, v: Array, w: Array) -> Array:
        """M s'' + C s' + g + d - B torque - J' force in the coordinates kept."""
        directions = self._directions
        force = self.lin.about.evaluate(directions.exact, at.t, y[:, : self.n], directions.unit(at.t))[0][:, :, 0]
        return super().of_arm(at, y, v, w) - self._size * force

    def ready(self, at: Places) -> None:
        """None: the push stands in no program."""


class PushedLoop(NonlinearLoop):
    """A nonlinear loop with a constant force at the tip."""

    def __init__(self, lin: Linearization, law: Law, directions: Directions, size: float):
        super().__init__(lin, law, Drive())
        self.friction = None
        self._pushing = directions, size

    def _equations_under(self, law: Law) -> NonlinearEquations:
        return PushedEquations(self.lin, law, *self._pushing)


def answer_nonlinearly(
    lin: Linearization, law: Law, stated: Disturbance, begin: float, t: Array, start: Array, tol: float
) -> tuple[Array, Array]:
    """States (S, 2n + k) with and without the disturbance at times t (S,) after `begin`, from the steady state `start` (2n + k,)."""

    def follow(loop: NonlinearLoop, times: Array, start: Array) -> Array:
        return loop.integrate(times, start, tol)[:, :-1]

    moments, drive = begin + t, scene_drive(lin)
    without = follow(NonlinearLoop(lin, law, drive), moments, start)
    if stated.kind == "push":
        until = int(np.searchsorted(t, stated.time * (1 + 1e-12), side="right"))
        pushed = follow(PushedLoop(lin, law, Directions(lin, stated.axis), stated.size), moments[:until], start)
        after = follow(NonlinearLoop(lin, law, drive), moments[until - 1 :], pushed[-1])
        return np.concatenate([pushed, after[1:]]), without
    if stated.kind == "step":
        step, forward = stated.size * np.eye(lin.about.m)[stated.joint], law.forward
        law = replace(law, forward=lambda t: forward(t) + step)
    away = np.zeros(len(start))
    away[: len(stated.start)] = stated.start
    return follow(NonlinearLoop(lin, law, drive), moments, start + away), without


Seen = Callable[[Array, Array], Array]
"""Times (N,) and states (N, 2n) -> what is looked at, (N,)."""


@immutable(eq=False)
class DisturbanceAnswer:
    """What a disturbance does to a loop, beside its steady motion.

    Attributes
    ----------
    words : str
        The disturbance as it was stated.
    seen : str
        What is looked at: the tip across the last link, along an axis, or a joint.
    unit : str
        Its unit.
    phases : array, shape (P,)
        Phases t / T at which the disturbance begins.
    t : array, shape (S,)
        Times after that, in s.
    linear : array, shape (P, S)
        The linear answer.
    settling : array, shape (P,)
        Time after which the answer stays within 2 % of its largest size about its end, in s; inf where it does not in this time.
    overshoot : array, shape (P,)
        A step: how far the answer goes beyond where it ends, relative to that. Otherwise the largest swing to the other side, relative
        to the first.
    worst : int
        The phase that settles last; of several the one that overshoots most.
    nonlinear : array, shape (S,), or None
        The nonlinear answer at the worst phase; None where it has none.
    problem : str
        Why there is no nonlinear answer.
    load : DriveLoad or None
        What the drives have to do in the nonlinear answer.
    """

    words: str
    seen: str
    unit: str
    phases: Array
    t: Array
    linear: Array
    settling: Array
    overshoot: Array
    worst: int
    nonlinear: Array | None
    problem: str
    load: DriveLoad | None

    @property
    def peak(self) -> float:
        """The largest linear answer at the worst phase, in `unit`."""
        return float(np.abs(self.linear[self.worst]).max())

    @property
    def difference(self) -> float:
        """The largest distance of the nonlinear answer from the linear one, relative to the peak; not a number without one."""
        if self.nonlinear is None:
            return float("nan")
        return float(np.abs(self.nonlinear - self.linear[self.worst]).max() / (self.peak or 1.0))


def respond(
    closed: Linearization,
    stated: Disturbance,
    law: Law | None = None,
    loop: PeriodicSystem | None = None,
    periods: float | None = None,
    tol: float = 1e-8,
    drives: Drives | None = None,
) -> DisturbanceAnswer:
    """Answer a disturbance of the steady motion, beginning at any phase, and by the nonlinear equations at the worst one.

        x' = A(t) x + b(t) u,   beside the periodic motion that the loop keeps

    Parameters
    ----------
    closed : Linearization
        The arm under the scene's own loop.
    stated : Disturbance
        A step, an initial state or a push.
    law, loop : Law and PeriodicSystem, optional
        Another feedback on the same arm, and its closed loop.
    periods : float, optional
        How long to look; by default until a thousandth is left.
    tol : float
        Wanted relative error.
    drives : Drives, optional
        Limits that the torque in the nonlinear answer is held against.

    Returns
    -------
    DisturbanceAnswer
        Settling and overshoot at each phase, the linear and the nonlinear answer.

    Raises
    ------
    ArgumentError
        When the loop is not stable: there is no steady motion to come back to.
    """
    law, loop = law or closed.law, loop or closed.periodic_system()
    found = floquet(loop, tol)
    if found.verdict != "stable":
        raise ArgumentError("the loop keeps no steady motion", got=f"{found.verdict}", expected="a stable loop")
    enters, T = of_plant(partial(disturb, closed, stated), 2 * closed.n, loop.n), closed.period
    count = steps_of(float(found.exponents[0].real), T, periods)
    size = 8 * len(PHASES) * count * (2 * loop.n + 4)
    check_size(f"an answer over {count / SAMPLES:.3g} periods", size, "ask for fewer periods")
    start = np.zeros(loop.n)
    start[: len(stated.start)] = stated.start
    t, states = answer_linearly(loop, enters, start, stated, count, tol)
    seen, what, unit = observe(closed, stated)
    times = PHASES[:, None] * T + t
    values = np.array([seen(row, x) for row, x in zip(times, states, strict=True)])
    ends = np.zeros(values.shape)
    if stated.kind == "step":  # it ends in the periodic answer to what lasts
        steady = forced_response(loop, lambda t: stated.size * enters(t)[:, :, 0], tol)
        ends = np.array([seen(row, steady(row)) for row in times])
    settling = np.array([settling_time(t, row, end) for row, end in zip(values, ends, strict=True)])
    over = np.array([overshoot(row, end) for row, end in zip(values, ends, strict=True)])
    worst = int(np.lexsort((-over, -settling))[0])
    nonlinear: Array | None = None
    problem, load, begin = "", None, PHASES[worst] * T
    try:
        first = forced_response(loop, of_plant(closed.forcing, 2 * closed.n, loop.n), tol)(np.array([begin]))[0]
        disturbed, without = answer_nonlinearly(closed, law, stated, begin, t, first, max(tol, 1e-9))
        nonlinear = seen(begin + t, disturbed - without)
        load = drive_load(closed, np.mod(begin + t, T), disturbed, law, drives)
    except NumericalError as error:
        problem = str(error)
    about = stated.words, what, unit, PHASES, t, values
    return DisturbanceAnswer(*about, settling, over, worst, nonlinear, problem, load)


def steps_of(growth: float, period: float, periods: float | None) -> int:
    """How many steps to follow: until a thousandth is left, 60 periods at the most, where no number of them is given."""
    settled = math.log(1 / SLIGHT) / (-growth * period)
    wanted = min(60, settled) if periods is None else positive("the number of periods", periods)
    return max(SAMPLES // 4, math.ceil(wanted * SAMPLES))


def observe(lin: Linearization, stated: Disturbance) -> tuple[Seen, str, str]:
    """What is looked at, as a function of times and states, its name and its unit: the tip, or the first coordinate without one."""
    if lin.arm.near.points is None:
        return (lambda t, x: x[:, 0]), lin.names[0], lin.coordinates[0].unit
    where = f"along {stated.axis}" if stated.axis else "across the last link"
    return Directions(lin, stated.axis).seen, f"tip {where}", "m"


def settling_time(t: Array, values: Array, end: Array) -> float:
    """The time after which values stay within SETTLING_BAND of their largest size about their end; inf where they do not."""
    outside = np.flatnonzero(np.abs(values - end) > SETTLING_BAND * np.abs(values).max())
    if not len(outside):
        return 0.0
    return float(t[outside[-1] + 1]) if outside[-1] + 1 < len(t) else float("inf")


def overshoot(values: Array, end: Array) -> float:
    """How far values go beyond their end, or to the other side of where they first went, as a part."""
    if np.abs(end).max() > 0:
        return max(0.0, float(np.abs(values).max() / np.abs(end).max()) - 1)
    first = np.argmax(np.abs(values) > 0.5 * np.abs(values).max())
    side = np.sign(values[first]) or 1.0
    ahead, back = float((side * values).max()), float((-side * values).max())
    return max(0.0, back / ahead) if ahead > 0 else 0.0


@immutable(eq=False)
class NoiseAnswer:
    """Root mean squares in the long run, beside the steady motion.

    Attributes
    ----------
    words : str
        The noise as it was stated.
    t : array, shape (N,)
        Times of a period, in s.
    states : array, shape (N, 2n)
        Of [y; y'], in their units.
    tip : array, shape (N,)
        Of the tip across the last link, in m; not numbers without a tip.
    error : float
        Relative error of the covariance.
    """

    words: str
    t: Array
    states: Array
    tip: Array
    error: float


def answer_noise(lin: Linearization, stated: Disturbance, loop: PeriodicSystem, tol: float = 1e-8) -> NoiseAnswer:
    """Find the periodic covariance of a loop under white torque noise at every input.

        P' = A P + P A' + S B B',   P(t + T) = P(t),   S = size^2 / (2 bandwidth)

    Assumes a bandwidth beyond what the loop follows. The loop must be stable; its equation is the dual one with time reversed.
    Raises: NotStable when it is not.
    """
    T = lin.period
    intensity = stated.size**2 / (2 * stated.time)
    spread = combine(lambda B: intensity * B @ np.swapaxes(B, 1, 2), of_plant(lin.input_matrix, 2 * lin.n, loop.n))
    solution = periodic_lyapunov(dual_system(loop), Backward(spread, T), tol)
    t = np.linspace(0.0, T, SAMPLES + 1)
    P = solution.X(np.mod(-t, T))[:, : 2 * lin.n, : 2 * lin.n]
    tip = np.full(len(t), np.nan)
    if lin.arm.near.points is not None:
        across = Directions(lin)
        rows = np.stack([across.seen(t, np.tile(row, (len(t), 1))) for row in np.eye(2 * lin.n)], axis=1)
        tip = np.sqrt(np.maximum(np.einsum("ti,tij,tj->t", rows, P, rows), 0.0))
    states = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    return NoiseAnswer(stated.words, t, states, tip, solution.error)


def answer_in_scene(
    scene: Scene, kind: Kind, words: str, loop: str = "own", periods: float | None = None, clock: Clock | None = None
) -> DisturbanceAnswer | NoiseAnswer:
    """Answer a disturbance in words of the scene's own loop, the open one, or a design's by its name.

    Raises: ArgumentError for words that cannot be read, an unknown loop, or one that is not stable.
    """
    table = None if loop in ("own", "open") else find_design(scene, loop)
    clock, tol = clock or Clock(scene.accuracy), max(scene.accuracy.tol, LEAST_TOL)
    shared = derive_equations(scene, clock)
    closed = shared.plant if loop == "open" else shared.closed
    stated = state_disturbance(kind, words, closed)
    law, system = closed.law, closed.periodic_system()
    if table is not None:
        made = clock.stage(f"design: {loop}", partial(design, shared.plant, table, scene.accuracy.tol))
        law, system = law.with_gain(made.K, made.controller), made.closed_loop
    if kind == "noise":
        return clock.stage("covariance", lambda: answer_noise(closed, stated, system, tol))
    return clock.stage("answer", lambda: respond(closed, stated, law, system, periods, tol, scene.drives))
