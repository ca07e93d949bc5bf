"""One loop on the arm: Floquet's verdict, the steady motion that it keeps, and what the drives have to do for it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.answers.clock import Clock
from flexlin.answers.steady import Response, find_response, response_error
from flexlin.checks import Array
from flexlin.control.drives import DriveLoad, drive_load
from flexlin.periodic.certificate.lyapunov import Certificate
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.accuracy import Accuracy
from flexlin.scene.control import DesignTable, Drives
from flexlin.scene.scene import Scene

if TYPE_CHECKING:
    from flexlin.control.designed_loop import Design
    from flexlin.control.estimator import Estimator

BY_TOL = ("periodic-lqr", "finite-horizon-lqr")
"""Designs whose gain has an error that can be asked for."""
LEAST = 1e-8
"""The smallest error that a sampled loop is asked for: a sampling time that never fits the period leaves more anyway."""

WORTH_PROOF = 1e-6
"""Decay per basic frequency from which a report tries to prove it: a slower one takes 10^5 periods to show, and most drown in rounding."""
PROOF = 5.0
"""Seconds of a report's 60 that a loop's certificate may take; `FloquetResult.certificate` takes what it needs."""


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


def judge_own_loops(scene: Scene, system: PeriodicSystem, loop: PeriodicSystem, clock: Clock) -> tuple[Loop, Loop]:
    """The scene's own loop and the open loop; one result for both where the scene has no feedback."""
    feedback, asked = scene.control.feedback, scene.accuracy
    if feedback is None:
        own = judge_loop("no feedback", "open", "Floquet: open loop", loop, asked, clock)
        return own, replace(own, name="open loop")
    kind = feedback.kind
    own = judge_loop(f"scene's {kind.upper()}", kind, "Floquet: the scene's loop", loop, asked, clock)
    return own, judge_loop("open loop", "open", "Floquet: open loop", system, asked, clock)


def describe_end(plant: Linearization) -> str:
    """Why the loops of a one-way motion have no verdict."""
    return f"the motion ends after {plant.period:g} s, so there are no exponents; the simulation shows what is left at its end"


def name_ending_loops(scene: Scene, plant: Linearization) -> tuple[Loop, Loop]:
    """The own loop and the open loop of a one-way motion."""
    feedback, why = scene.control.feedback, describe_end(plant)
    bare = Loop("open loop", "open", None, why, ends=True)
    if feedback is None:
        return replace(bare, name="no feedback"), bare
    return Loop(f"scene's {feedback.kind.upper()}", feedback.kind, None, why, ends=True), bare


def judge_elastic_loop(closed: Linearization, asked: Accuracy, clock: Clock) -> Loop:
    """The scene's own loop, linearized about the periodic motion of the elastic arm in the place of the rigid one."""
    from flexlin.about.elastic import linearize_about
    from flexlin.about.periodic_motion import periodic_motion

    name, problems = "about elastic motion", dict[str, str]()
    motion = clock.attempt(
        problems,
        name,
        "periodic motion of the elastic arm",
        asked,
        lambda: periodic_motion(closed, tol=asked.tol),
        lambda found: found.error,
    )
    if motion is None:
        return Loop(name, "elastic", None, problems[name])
    return judge_loop(name, "elastic", "Floquet: about the elastic motion", linearize_about(motion), asked, clock)


def judge_loop(
    name: str, kind: str, step: str, system: PeriodicSystem, asked: Accuracy, clock: Clock, made: "Design | None" = None
) -> Loop:
    """Floquet's verdict on a loop, or why there is none."""
    problems: dict[str, str] = {}
    result = clock.attempt(problems, name, step, asked, lambda: floquet(system, asked.tol), exponent_error)
    proof = None
    if result is not None and is_worth_proof(result):
        step = f"certificate: {name}"
        proof = clock.attempt(dict[str, str](), name, step, asked, result.certificate, at_most=PROOF)
    return Loop(name, kind, result, problems.get(name, ""), made, certificate=proof)


def is_worth_proof(result: FloquetResult) -> bool:
    """Whether a loop is stable, and decays fast enough for a proof in a report."""
    slowest = -float(result.exponents.real.max())
    return result.verdict == "stable" and slowest > WORTH_PROOF * 2 * pi / result.period


def design_and_judge(plant: Linearization, table: DesignTable, asked: Accuracy, clock: Clock) -> Loop:
    """A designed controller with the verdict on its closed loop."""
    from flexlin.control.catalogue import design

    problems: dict[str, str] = {}
    error_of = (lambda made: float(made.error)) if table.kind in BY_TOL else None
    work = partial(design, plant, table, asked.tol)
    made = clock.attempt(problems, table.name, f"design: {table.name}", asked, work, error_of)
    if made is None:
        return Loop(table.name, table.kind, None, problems[table.name])
    if not plant.motion.periodic:
        return Loop(table.name, table.kind, None, describe_end(plant), made, ends=True)
    return judge_loop(table.name, table.kind, f"Floquet: {table.name}", made.closed_loop, asked, clock, made)


def with_response(
    loop: Loop, closed: Linearization, t: Array, asked: Accuracy, clock: Clock, system: PeriodicSystem | None = None
) -> Loop:
    """The loop with its periodic response to what the feedforward leaves over, where it keeps one and its states are the arm's."""
    system = loop.design.closed_loop if loop.design is not None else system
    if system is None or loop.verdict not in ("stable", "undecided"):
        return loop
    name, problems, known = f"forced response: {loop.name}", dict[str, str](), system
    found = clock.attempt(
        problems, name, name, asked, lambda: find_response(closed, known, t, asked.tol), response_error
    )
    return replace(loop, response=found)


def judge_sampled_loops(
    scene: Scene, loops: Sequence[Loop], plant: Linearization, closed: Linearization, clock: Clock
) -> tuple[Loop, ...]:
    """The loops with a feedback on the arm's own states once more, their torque sampled, held and late as the scene says."""
    sampling, asked, found = scene.control.sampling, scene.accuracy, list[Loop]()
    if sampling is None:
        return ()
    from flexlin.periodic.sampled.stability import sampled_floquet

    for loop in loops:
        law = closed.law if loop.design is None else loop.design.law
        if loop.floquet is None or loop.kind == "open":
            continue
        name, problems = f"{loop.name}, sampled", dict[str, str]()
        rates = None if law.controller is None else law.controller.rates
        given = law.gain, sampling.period, sampling.delay, max(asked.tol, LEAST), rates
        work = partial(sampled_floquet, plant.periodic_system(), *given)
        result = clock.attempt(problems, name, f"Floquet: {name}", asked, work)
        found.append(Loop(name, "sampled", result, problems.get(name, "")))
    return tuple(found)


def judge_estimated_loops(scene: Scene, loops: Sequence[Loop], plant: Linearization, clock: Clock) -> tuple[Loop, ...]:
    """The designs that name sensors once more, their states estimated by a Kalman filter."""
    asked, tables, found = scene.accuracy, {table.name: table.estimator for table in scene.designs}, list[Loop]()
    for loop in loops:
        table, made = tables[loop.name], loop.design
        if table is None or made is None or not plant.motion.periodic:
            continue
        from flexlin.control.estimator import output_feedback
        from flexlin.control.sensors import scene_sensors

        name, problems, sensors = f"{loop.name}, estimated", dict[str, str](), scene_sensors(scene, plant, table)
        step = f"estimator: {loop.name}"
        estimator = clock.attempt(problems, name, step, asked, partial(sensors.filter, plant, asked.tol), filter_error)
        if estimator is None:
            found.append(Loop(name, "lqg", None, problems[name]))
            continue
        system = output_feedback(made, estimator)
        found.append(judge_loop(name, "lqg", f"Floquet: {name}", system, asked, clock))
    return tuple(found)


def filter_error(found: "Estimator") -> float:
    """The relative error of a filter's covariance."""
    return found.error


def load_of(
    loop: Loop, plant: Linearization, closed: Linearization, t: Array, drives: Drives | None
) -> DriveLoad | None:
    """What the drives have to do in the steady motion of a loop; t holds both ends of the period."""
    response = loop.response
    if response is None or loop.verdict in ("unstable", "failed") or not plant.about.m:
        return None
    law = response.law or closed.law
    if loop.design is not None:
        law = law.with_gain(loop.design.K, loop.design.controller)
    elif loop.kind == "open":
        law = law.with_gain(np.zeros((plant.about.m, 2 * plant.n)))
    return drive_load(plant, t[:-1], response.states[:-1], law, drives)


def exponent_error(result: FloquetResult) -> float:
    """The largest error of a resolved exponent, in 1/s up to |exponent| = 1/s and relative beyond, as it is asked for."""
    known = np.isfinite(result.errors)
    return float((result.errors / np.maximum(1.0, np.abs(result.exponents)))[known].max(initial=0.0))
