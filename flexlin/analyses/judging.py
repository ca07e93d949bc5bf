"""One loop on the arm: Floquet's verdict, the steady motion it keeps, what drives do for it, and whether the linear model holds there."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf, pi
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from flexlin.analyses.clock import Clock
from flexlin.checks import Array
from flexlin.control.drives import DriveLoad, drive_load
from flexlin.control.tracking import scene_feedforward, tip_positions
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.certificate import Certificate
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.response.forced import ForcedResponse, forced_response
from flexlin.periodic.system import OfPlant, PeriodicSystem
from flexlin.scene.control import DesignTable
from flexlin.scene.scene import Accuracy, Scene

if TYPE_CHECKING:
    from flexlin.control.designed_loop import Design

Answer = TypeVar("Answer")

BY_TOL = ("periodic-lqr", "finite-horizon-lqr")
"""Designs whose gain has an error that can be asked for."""
LEAST_TOL = 1e-8
"""The smallest error that is asked for of sampled loops, whose time may never fit the period, and of disturbances, of which plots show
three digits."""

WORTH_PROOF = 1e-6
"""Decay per basic frequency from which a report tries to prove it: a slower one takes 10^5 periods to show, and most drown in rounding."""
CERTIFICATE_SECONDS = 5.0
"""Seconds of a report's 60 that a loop's certificate may take; `FloquetResult.certificate` takes what it needs."""


@dataclass(frozen=True)
class Followed:
    """The elastic motion that a feedforward leads along, in the place of a forced response: any stable loop keeps it."""

    error: float
    status: str
    amplification: float = float("nan")


@dataclass(frozen=True)
class Response:
    """The periodic response of a loop: states [y; y'; z] (N, 2n + k), and how far the tip is from its rigid motion, (N, 2) in m.

    `tip_by_bending` is the part of it that is left when only the elastic coordinates deviate; `law` commands the torque where a
    feedforward leads along an elastic motion.
    """

    solution: ForcedResponse | Followed
    states: Array
    tip: Array
    tip_by_bending: Array
    law: Law | None = None

    @property
    def tip_error(self) -> Array:
        """The distance of the tip from its rigid motion, (N,) in m; not a number where the model has no points."""
        return np.linalg.norm(self.tip, axis=1)

    @property
    def sizes(self) -> tuple[float, float]:
        """The largest tip error by bending alone, and the largest of all, in m."""
        return float(np.linalg.norm(self.tip_by_bending, axis=1).max()), float(self.tip_error.max())


def find_response(closed: Linearization, loop: PeriodicSystem, t: Array, tol: float) -> Response:
    """The periodic response to what the rigid motion leaves over, and what it does to the tip."""
    forward = scene_feedforward(closed, tol)
    solution: ForcedResponse | Followed
    if forward is None:
        solution = forced_response(loop, OfPlant(closed.forcing, 2 * closed.n, loop.n), tol)
        states = solution(t)
    else:
        reference = forward.law.reference(t)
        states = np.concatenate([reference, np.zeros((len(t), loop.n - 2 * closed.n))], axis=1)
        solution = Followed(forward.error * float(np.abs(states).max()), forward.status)
    bent = states[:, : 2 * closed.n] * [coordinate.kind == "elastic" for coordinate in closed.coordinates * 2]
    rigid = tip_positions(closed, t, np.zeros_like(states))
    tip, by_bending = (tip_positions(closed, t, x) - rigid for x in (states, bent))
    return Response(solution, states, tip, by_bending, None if forward is None else forward.law)


def response_error(found: Response) -> float:
    """The error of the states, relative to the largest, absolute below 1."""
    return found.solution.error / max(1.0, float(np.abs(found.states).max()))


def arm_length(plant: Linearization) -> float:
    """The length of the arm from the base over its joints to the tip, in m, as the motion begins; not a number where it has no points."""
    if plant.arm.near.points is None:
        return float("nan")
    points = plant.about.near.of_arm("points", np.zeros(1), np.zeros((1, plant.n)))[0]
    return float(np.linalg.norm(np.diff(points, axis=1), axis=0).sum())


SMALL_SHARE = 0.2
"""The share of the arm's length beyond which a deflection is not small, and of the largest deviation by which the linear answer may miss
the nonlinear one."""
REPEATABILITY = 1e-5
"""A share of the arm's length of the order in which good arms repeat a motion (some 0.01 mm for 1 m, ISO 9283): nothing is gained
below it."""
COVERED_SHARE = 0.5
"""A simulation speaks for a steady deviation of which it has reached this share."""

What = Literal["bending", "tip", "difference", "stopped"]


@dataclass(frozen=True)
class ModelEvidence:
    """One figure against its bound, in `unit`; `share` is its part of `whole` (the arm's length, or the largest deviation).

    what: the bending or the whole tip error of the steady motion, the difference between the linear and the nonlinear answer, or
    the time at which the nonlinear equations ended.
    """

    what: What
    value: float
    bound: float
    unit: str
    whole: float = float("nan")

    @property
    def against(self) -> bool:
        """Whether it speaks against the linear model."""
        return not self.value <= self.bound

    @property
    def share(self) -> float:
        """The value as a part of the whole."""
        return self.value / self.whole if self.whole > 0 else float("nan")


@dataclass(frozen=True)
class ModelValidity:
    """Whether the linear model holds along the motion: valid, invalid, or unknown where nothing compares it with the nonlinear one."""

    verdict: Literal["valid", "invalid", "unknown"]
    evidence: tuple[ModelEvidence, ...] = ()

    @property
    def reason(self) -> ModelEvidence | None:
        """The figure that speaks against the linear model, of several the one that says most to a reader."""
        against = {found.what: found for found in self.evidence if found.against}
        return next((against[what] for what in ("tip", "bending", "difference", "stopped") if what in against), None)


def judge_model(
    length: float,
    steady: tuple[float, float] | None = None,
    simulated: tuple[float, float, float, str] | None = None,
    stopped: tuple[float, float] | None = None,
    curved: bool = False,
) -> ModelValidity:
    """Judge the linear model by what is known of a loop's motion.

    The steady motion's tip error may not exceed SMALL_SHARE of the arm, unless a simulation that came as far agrees; nor may its bending,
    where only links that bend as curves (`curved`) make the simulation a judge of it. The linear answer may miss the nonlinear one by
    SMALL_SHARE of the largest deviation, or by what no arm repeats. A simulation that ended outside the equations' range is against it.

    Parameters: length: of the arm in m, not a number where it has no points; steady: bending and tip error in m of a steady motion that
    the loop keeps; simulated: how far the answers are apart, the largest deviation, the error of the first, the unit; stopped: when
    the simulation left the range of the equations, and when it was to end, in s.
    """
    found: list[ModelEvidence] = []
    if simulated is not None:
        apart, largest, error, unit = simulated
        floor = REPEATABILITY * length if unit == "m" and np.isfinite(length) else REPEATABILITY
        found.append(ModelEvidence("difference", apart, max(SMALL_SHARE * largest, error, floor), unit, largest))
    if stopped is not None:
        found.append(ModelEvidence("stopped", stopped[1], stopped[0], "s", stopped[1]))
    if steady is not None and np.all(np.isfinite([*steady, length])):
        bending, tip = steady
        confirmed = simulated is not None and not found[0].against and simulated[1] >= COVERED_SHARE * tip
        far = confirmed and curved
        found.append(ModelEvidence("bending", bending, np.inf if far else SMALL_SHARE * length, "m", length))
        found.append(ModelEvidence("tip", tip, np.inf if confirmed else SMALL_SHARE * length, "m", length))
    if any(figure.against for figure in found):
        return ModelValidity("invalid", tuple(found))
    return ModelValidity("unknown" if simulated is None else "valid", tuple(found))


@dataclass(frozen=True)
class Loop:
    """One loop on the arm and Floquet's verdict on it; `problem` says why there is none, `design` is the designed controller, if any,
    `response` the loop's periodic response, if that is known and kept: an unstable loop leaves it,
    `certificate` the proof that it is stable; `ends`: its motion is one-way, and has no exponents."""

    name: str
    kind: str
    floquet: FloquetResult | None
    problem: str = ""
    design: "Design | None" = None
    response: Response | None = None
    certificate: Certificate | None = None
    ends: bool = False

    @property
    def verdict(self) -> str:
        """stable, unstable, undecided, one-way, or failed where there is no answer."""
        if self.ends and self.floquet is None:
            return "one-way"
        return "failed" if self.floquet is None else self.floquet.verdict

    @property
    def steady(self) -> tuple[float, float] | None:
        """The bending and the tip error of the steady motion that the loop keeps, in m, where there is one."""
        return None if self.response is None or self.verdict in ("unstable", "failed") else self.response.sizes

    @property
    def growth(self) -> tuple[float, float]:
        """The largest growth rate and its error, in 1/s."""
        if self.floquet is None:
            return float("nan"), float("nan")
        return float(self.floquet.exponents[0].real), float(self.floquet.errors[0])


@dataclass
class Stages:
    """What all stages of an analysis share: the arm alone and with the scene's own loop, times of a period with both ends, and the clock
    that keeps each stage within its limits; `problems` says what is missing."""

    scene: Scene
    clock: Clock
    plant: Linearization
    closed: Linearization
    t: Array
    problems: dict[str, str] = field(default_factory=dict)

    @property
    def asked(self) -> Accuracy:
        """How accurate the answers should be, and what they may cost."""
        return self.scene.accuracy

    def attempt(
        self,
        key: str,
        name: str,
        work: Callable[[], Answer],
        error_of: Callable[[Answer], float] | None = None,
        asked: Accuracy | None = None,
        at_most: float = inf,
    ) -> Answer | None:
        """Do the work of a stage; where it has no trustworthy answer, `problems` says why under `key`."""
        return self.clock.attempt(self.problems, key, name, asked or self.asked, work, error_of, at_most=at_most)

    def attempt_alone(
        self,
        name: str,
        work: Callable[[], Answer],
        error_of: Callable[[Answer], float] | None = None,
        at_most: float = inf,
    ) -> tuple[Answer | None, str]:
        """The answer of a stage about one loop, or why it has none."""
        return self.attempt(name, name, work, error_of, at_most=at_most), self.problems.pop(name, "")


def judge_own_loops(a: Stages) -> tuple[Loop, Loop]:
    """The scene's own loop and the open loop; one result for both where the scene has no feedback; a motion that ends has no verdict."""
    feedback = a.scene.control.feedback
    name, kind = ("no feedback", "open") if feedback is None else (f"scene's {feedback.kind.upper()}", feedback.kind)
    if not a.plant.motion.periodic:
        bare = Loop("open loop", "open", None, describe_end(a.plant), ends=True)
        return replace(bare, name=name, kind=kind), bare
    step = "open loop" if feedback is None else "the scene's loop"
    own = judge_loop(a, name, kind, f"Floquet: {step}", a.closed.periodic_system())
    if feedback is None:
        return own, replace(own, name="open loop")
    return own, judge_loop(a, "open loop", "open", "Floquet: open loop", a.plant.periodic_system())


def describe_end(plant: Linearization) -> str:
    """Why the loops of a one-way motion have no verdict."""
    return f"the motion ends after {plant.period:g} s, so there are no exponents; the simulation shows what is left at its end"


def judge_elastic_loop(a: Stages) -> Loop:
    """The scene's own loop, linearized about the periodic motion of the elastic arm in the place of the rigid one."""
    from flexlin.linearization.periodic_motion import linearize_about, periodic_motion

    name, work = "about elastic motion", partial(periodic_motion, a.closed, tol=a.asked.tol)
    found = a.attempt_alone("periodic motion of the elastic arm", work, lambda made: made.error)
    motion, problem = found
    if motion is None:
        return Loop(name, "elastic", None, problem)
    return judge_loop(a, name, "elastic", "Floquet: about the elastic motion", linearize_about(motion))


def judge_loop(
    a: Stages, name: str, kind: str, step: str, system: PeriodicSystem, made: "Design | None" = None
) -> Loop:
    """Floquet's verdict on a loop, or why there is none."""
    found = a.attempt_alone(step, lambda: floquet(system, a.asked.tol), exponent_error)
    result, problem = found
    loop = Loop(name, kind, result, problem, made)
    if result is None or loop.verdict != "stable" or -loop.growth[0] <= WORTH_PROOF * 2 * pi / result.period:
        return loop
    return replace(
        loop, certificate=a.attempt_alone(f"certificate: {name}", result.certificate, at_most=CERTIFICATE_SECONDS)[0]
    )


def judge_designs(a: Stages) -> tuple[Loop, ...]:
    """The scene's designs with their verdicts and the steady motions that they keep."""
    return tuple(with_response(a, judge_design(a, table)) for table in a.scene.designs)


def judge_design(a: Stages, table: DesignTable) -> Loop:
    """A designed controller with the verdict on its closed loop."""
    from flexlin.control.catalogue import design

    error_of = (lambda made: float(made.error)) if table.kind in BY_TOL else None
    made, problem = a.attempt_alone(f"design: {table.name}", partial(design, a.plant, table, a.asked.tol), error_of)
    if made is None:
        return Loop(table.name, table.kind, None, problem)
    if not a.plant.motion.periodic:
        return Loop(table.name, table.kind, None, describe_end(a.plant), made, ends=True)
    if made.sample_time is not None:
        judged = a.attempt_alone(f"Floquet: {table.name}", partial(made.floquet, max(a.asked.tol, LEAST_TOL)))
        return Loop(table.name, made.kind, *judged, made)
    return judge_loop(a, table.name, table.kind, f"Floquet: {table.name}", made.closed_loop, made)


def with_response(a: Stages, loop: Loop, system: PeriodicSystem | None = None) -> Loop:
    """The loop with its periodic response to what the feedforward leaves over, where it keeps one and its states are the arm's."""
    known = loop.design.closed_loop if loop.design is not None else system
    sampled = loop.design is not None and loop.design.sample_time is not None
    if known is None or sampled or loop.verdict not in ("stable", "undecided"):
        return loop
    work = partial(find_response, a.closed, known, a.t, a.asked.tol)
    return replace(loop, response=a.attempt_alone(f"forced response: {loop.name}", work, response_error)[0])


def judge_sampled_loops(a: Stages, loops: Sequence[Loop]) -> tuple[Loop, ...]:
    """The loops with a feedback on the arm's own states once more, their torque sampled, held and late as the scene says."""
    sampling, found = a.scene.control.sampling, list[Loop]()
    if sampling is None:
        return ()
    from flexlin.periodic.sampled import sampled_floquet

    for loop in loops:
        law = a.closed.law if loop.design is None else loop.design.law
        if loop.floquet is None or loop.kind == "open" or (loop.design is not None and loop.design.sample_time):
            continue
        rates = None if law.controller is None else law.controller.rates
        given = law.gain, sampling.period, sampling.delay, max(a.asked.tol, LEAST_TOL), rates
        name, work = f"{loop.name}, sampled", partial(sampled_floquet, a.plant.periodic_system(), *given)
        found.append(Loop(name, "sampled", *a.attempt_alone(f"Floquet: {name}", work)))
    return tuple(found)


def judge_estimated_loops(a: Stages, loops: Sequence[Loop]) -> tuple[Loop, ...]:
    """The designs that name sensors once more, their states estimated by a Kalman filter."""
    tables, found = {table.name: table.estimator for table in a.scene.designs}, list[Loop]()
    for loop in loops:
        table, made = tables[loop.name], loop.design
        if table is None or made is None or not a.plant.motion.periodic:
            continue
        from flexlin.control.estimator import output_feedback
        from flexlin.control.sensors import scene_sensors

        name = f"{loop.name}, estimated"
        work = partial(scene_sensors(a.scene, a.plant, table).filter, a.plant, a.asked.tol)
        filtered = a.attempt_alone(f"estimator: {loop.name}", work, lambda known: known.error)
        estimator, problem = filtered
        if estimator is None:
            found.append(Loop(name, "lqg", None, problem))
        else:
            found.append(judge_loop(a, name, "lqg", f"Floquet: {name}", output_feedback(made, estimator)))
    return tuple(found)


def load_of(a: Stages, loop: Loop) -> DriveLoad | None:
    """What the drives have to do in the steady motion of a loop."""
    response, plant = loop.response, a.plant
    if response is None or loop.verdict in ("unstable", "failed") or not plant.about.m:
        return None
    law = response.law or a.closed.law
    if loop.design is not None:
        law = law.with_gain(loop.design.K, loop.design.controller)
    elif loop.kind == "open":
        law = law.with_gain(np.zeros((plant.about.m, 2 * plant.n)))
    return drive_load(plant, a.t[:-1], response.states[:-1], law, a.scene.drives)


def exponent_error(result: FloquetResult) -> float:
    """The largest error of a resolved exponent, in 1/s up to |exponent| = 1/s and relative beyond, as it is asked for."""
    known = np.isfinite(result.errors)
    return float((result.errors / np.maximum(1.0, np.abs(result.exponents)))[known].max(initial=0.0))
