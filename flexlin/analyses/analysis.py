"""All numbers of a report, from one scene."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from flexlin.analyses.boundary import Margin
from flexlin.analyses.clock import Answer, Clock, Measure, Step
from flexlin.analyses.judging import LEAST_TOL, Loop, ModelValidity, Response, arm_length, find_response, judge_model
from flexlin.analyses.loops import SAMPLED, TIMES
from flexlin.checks import SAMPLES, Array
from flexlin.control.catalogue import design, pose_design
from flexlin.control.designed_loop import Design
from flexlin.control.drives import DriveLoad, drive_load
from flexlin.control.estimator import output_feedback
from flexlin.control.sensors import scene_sensors, tip_zeros
from flexlin.control.validity import Validity, linear_range
from flexlin.errors import InputError, SimulationStopped
from flexlin.linearization.linear import Coefficients, linearize, with_control
from flexlin.linearization.linearization import Linearization
from flexlin.linearization.periodic_motion import linearize_about, periodic_motion
from flexlin.mechanics import Manipulator, build_manipulator
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.resonance import Resonance, find_resonances
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.margins import Margins, margins
from flexlin.periodic.sampled import sampled_floquet
from flexlin.periodic.system import PeriodicSystem, extend_system
from flexlin.periodic.zeros import InvariantZeros
from flexlin.scene.control import DesignTable
from flexlin.scene.parameters import PARAMETERS
from flexlin.scene.scene import Accuracy, Scene
from flexlin.simulation.result import Simulation
from flexlin.simulation.run import simulate

if TYPE_CHECKING:
    import xarray

    from flexlin.analyses.audit import Audit
    from flexlin.analyses.nearest import NearestInstability

SIMULATED_PERIODS = 3.0
SIMULATED_DURATIONS = 1.5
"""Durations of a one-way motion that are simulated: it rests after its end."""
RANGE_TOL = 1e-4
"""Relative width to which the range of the linear equations is found: three digits are printed, and times are sampled."""
ZEROS_TOL = 1e-6
"""Wanted error of the zeros of tip control, in 1/s up to 1/s and relative beyond: three digits are printed, and the sign counts."""
BY_TOL = ("periodic-lqr", "finite-horizon-lqr")
"""Designs whose gain has an error that can be asked for."""
WORTH_PROOF = 1e-6
"""Decay per basic frequency from which a report tries to prove it: a slower one takes 10^5 periods to show, and most drown in rounding."""
CERTIFICATE_SECONDS = 5.0
"""Seconds of a report's 60 that a loop's certificate may take; `FloquetResult.certificate` takes what it needs."""


@dataclass
class Stages:
    """What all stages of an analysis share: the arm alone and with the scene's own loop, times of a period with both ends, and the clock
    that keeps each stage within its limits; `problems` says what is missing, `unanswered` what of it somebody asked for."""

    scene: Scene
    clock: Clock
    plant: Linearization
    closed: Linearization
    t: Array
    problems: dict[str, str] = field(default_factory=dict)
    unanswered: list[str] = field(default_factory=list)

    @property
    def asked(self) -> Accuracy:
        """How accurate the answers should be, and what they may cost."""
        return self.scene.accuracy

    def attempt(
        self,
        key: str,
        name: str,
        work: Callable[[], Answer],
        error_of: Measure = None,
        wanted: bool = False,
        **how: float,
    ) -> Answer | None:
        """As `Clock.attempt`; where there is no trustworthy answer, `problems` says why under `key`; `wanted`: somebody asked for it."""
        answer, problem = self.clock.attempt(name, work, error_of, **how)
        self.problems |= {key: problem} if problem else {}
        self.unanswered += [key] if problem and wanted else []
        return answer


@dataclass
class Analysis(Stages):
    """What a report says: `own` is the scene's own loop, `open_loop` the arm without feedback; each of the others is filled by a stage.

    `elastic`: the own loop about the elastic motion, if the scene asks for it; `resonances`: what is behind an unstable own loop;
    `stopped`: why the simulation ended early; `linear_range`: how far the linear equations hold; `zeros`: those from motors to tip;
    `sampled`, `estimated`: loops once more, sampled and held, or with their states estimated; `margins`: of the scene's numbers; `endured`:
    of loops by their names; `nearest`: the smallest change of uncertain numbers that makes the own loop unstable; `audit`, `sensitivity`:
    which effects and numbers matter.
    """

    coefficients: Coefficients = field(kw_only=True)
    own: Loop = field(kw_only=True)
    open_loop: Loop = field(kw_only=True)
    elastic: Loop | None = None
    resonances: tuple[Resonance, ...] = ()
    simulation: Simulation | None = None
    stopped: SimulationStopped | None = None
    linear_range: Validity | None = None
    zeros: InvariantZeros | None = None
    designs: tuple[Loop, ...] = ()
    sampled: tuple[Loop, ...] = ()
    estimated: tuple[Loop, ...] = ()
    margins: tuple[Margin, ...] = ()
    endured: dict[str, Margins] = field(default_factory=dict)
    nearest: "NearestInstability | None" = None
    audit: "Audit | None" = None
    sensitivity: "xarray.Dataset | None" = None
    steps: tuple[Step, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all that was asked for has an answer: the scene's own loop, its designs, and what options and tables ask beside them."""
        judged = all(loop.verdict != "failed" for loop in self.loops if loop is not self.open_loop)
        return judged and not self.unanswered and not (self.audit and self.audit.problem)

    def validity(self, loop: Loop) -> ModelValidity:
        """Whether the linear model can be believed along the motion under one of the loops; only the own loop is simulated."""
        if loop is not self.own:
            return judge_model(self.length, loop.steady)
        run, end = self.simulation, self.stopped
        simulated = None if run is None or run.is_unresolved else (*run.apart[1:], run.unit.strip())
        ended = None if end is None or not end.left_range else (end.t, SIMULATED_PERIODS * self.plant.period)
        curved = self.plant.arm.near is not self.plant.arm and "geometric_stiffening" in self.scene.effects.on()
        return judge_model(self.length, loop.steady, simulated, ended, curved)

    def load(self, loop: Loop) -> DriveLoad | None:
        """What the drives have to do in the steady motion that a loop keeps, where that is known."""
        response, plant = loop.response, self.plant
        if response is None or loop.verdict in ("unstable", "failed") or not plant.about.m:
            return None
        law = response.law or self.closed.law
        if loop.design is not None:
            law = law.with_gain(loop.design.K, loop.design.controller)
        elif loop.kind == "open":
            law = law.with_gain(np.zeros((plant.about.m, 2 * plant.n)))
        return drive_load(plant, self.t[:-1], response.states[:-1], law, self.scene.drives)

    @property
    def response(self) -> Response | None:
        """The periodic response of the scene's own loop, where it has one."""
        return self.own.response

    @property
    def length(self) -> float:
        """The length of the arm, in m; not a number where it has no points."""
        return arm_length(self.plant)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Open loop, own loop (about the elastic motion too), designs, sampled ones; no open loop where the scene has no feedback."""
        first = () if self.own.kind == "open" else (self.open_loop,)
        elastic = () if self.elastic is None else (self.elastic,)
        return (*first, self.own, *elastic, *self.designs, *self.estimated, *self.sampled)


def analyse(scene: Scene, clock: Clock | None = None, free: Sequence[str] = ()) -> Analysis:
    """Linearize a scene's arm along its motion, judge every loop by Floquet, and compare with the nonlinear equations.

    Every stage is asked for `scene.accuracy.tol` and kept within the limits that stand beside it; where no tol is given the nonlinear
    check is asked for what its comparison needs.

    Parameters: clock: collects the steps, and reports their progress; free: numbers of the scene that the equations keep as symbols where
    they can, with the scene's own values, for who asks about them later.
    Returns: an `Analysis`; a stage that fails or meets a limit is a message in it.
    Raises: InputError for a scene that cannot be used; NumericalError when there are no linear equations.
    """
    shared = derive_equations(scene, clock or Clock(scene.accuracy), free)
    coefficients = shared.clock.stage("coefficients over a period", partial(shared.plant.sample, shared.t))
    own, open_loop = judge_own_loops(shared)
    a = Analysis(**vars(shared), coefficients=coefficients, own=own, open_loop=open_loop)
    if a.plant.motion.periodic:
        judge_period(a)
    else:
        a.problems |= dict.fromkeys(("response", "linear range"), describe_end(a.plant))
        follow_nonlinear(a)
        a.designs = judge_designs(a)
    a.steps = tuple(a.clock.steps)
    return a


def build_with_free(scene: Scene, free: Sequence[str]) -> Manipulator:
    """The manipulator, with numbers left free where all of them can be, and mean the same there without a look at a model's code."""
    moving = scene.motion.kind not in SAMPLED and getattr(scene.motion, "course", "") != "one-way"
    if free and moving and not any(path.startswith(f"{PARAMETERS}.") or path in TIMES for path in free):
        with suppress(InputError):
            return build_manipulator(scene, free)
    return build_manipulator(scene)


def judge_period(a: Analysis) -> None:
    """The stages of a report that only a periodic motion has, and what all have between them."""
    a.elastic = judge_elastic_loop(a) if a.scene.control.about == "elastic" else None
    system, result = a.closed.periodic_system(), a.own.floquet
    if result is not None and result.verdict == "unstable":
        look = partial(find_resonances, system, floquet_modes(system, result))
        a.resonances = tuple(a.attempt("resonances", "cause of the instability", look) or ())
    work = partial(find_response, a.closed, system, a.t, a.asked.tol, rest=True)
    response = a.attempt("response", "forced response", work, lambda found: found.relative_error)
    a.own = replace(a.own, response=response)
    follow_nonlinear(a)
    if result is None:
        a.problems["linear range"] = "no Floquet modes are known to measure it along"
    else:
        reach = partial(linear_range, a.closed, result=result, tol=max(RANGE_TOL, a.asked.tol), plant=a.plant)
        a.linear_range = a.attempt("linear range", "range of the linear equations", reach)
    if 0 < len(a.plant.driven) <= 2 and a.plant.n != len(a.plant.driven) and a.plant.arm.points is not None:
        a.zeros = a.attempt("zeros", "zeros of tip control", partial(tip_zeros, a.plant, max(ZEROS_TOL, a.asked.tol)))
    a.designs = judge_designs(a)
    a.sampled = judge_sampled_loops(a)
    a.estimated = judge_estimated_loops(a)
    bare = replace(a.own, name="open loop")
    a.open_loop = bare if a.own.kind == "open" else with_response(a, a.open_loop, a.plant.periodic_system())


def derive_equations(scene: Scene, clock: Clock, free: Sequence[str] = ()) -> Stages:
    """The arm alone, and with the scene's own loop; limits of the drives and designs that do not fit are refused before any other work."""
    arm = clock.stage("equations of motion", lambda: build_with_free(scene, free))

    def work() -> tuple[Linearization, Linearization]:
        plant = linearize(arm, scene.motion)
        closed = with_control(plant, scene.control)
        drive_load(plant, np.zeros(1), np.zeros((1, 2 * plant.n)), plant.law, scene.drives)
        for table in scene.designs:
            pose_design(plant, table)
        return plant, closed

    plant, closed = clock.stage("linearization", work)
    if plant.motion.origin:
        clock.note(f"the motion is made from {plant.motion.origin}")
    return Stages(scene, clock, plant, closed, np.linspace(0.0, plant.period, SAMPLES + 1))


def plant_and_designs(scene: Scene, clock: Clock) -> tuple[Linearization, tuple[Loop, ...]]:
    """The open-loop linearization of a scene, and its designs with their verdicts, as accurate as the scene asks."""
    shared = derive_equations(scene, clock)
    return shared.plant, judge_designs(shared)


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
    name, work = "about elastic motion", partial(periodic_motion, a.closed, tol=a.asked.tol)
    motion, problem = a.clock.attempt("periodic motion of the elastic arm", work, lambda made: made.error)
    if motion is None:
        return Loop(name, "elastic", None, problem)
    return judge_loop(a, name, "elastic", "Floquet: about the elastic motion", linearize_about(motion))


def judge_loop(a: Stages, name: str, kind: str, step: str, system: PeriodicSystem, made: Design | None = None) -> Loop:
    """Floquet's verdict on a loop, or why there is none."""
    result, problem = a.clock.attempt(step, lambda: floquet(system, a.asked.tol), exponent_error)
    loop = Loop(name, kind, result, problem, made)
    if result is None or loop.verdict != "stable" or -loop.growth[0] <= WORTH_PROOF * 2 * pi / result.period:
        return loop
    proof, _ = a.clock.attempt(f"certificate: {name}", result.certificate, at_most=CERTIFICATE_SECONDS)
    return replace(loop, certificate=proof)


def judge_designs(a: Stages) -> tuple[Loop, ...]:
    """The scene's designs with their verdicts and the steady motions that they keep."""
    return tuple(with_response(a, judge_design(a, table)) for table in a.scene.designs)


def judge_design(a: Stages, table: DesignTable) -> Loop:
    """A designed controller with the verdict on its closed loop."""
    error_of = (lambda made: float(made.error)) if table.kind in BY_TOL else None
    made, problem = a.clock.attempt(f"design: {table.name}", partial(design, a.plant, table, a.asked.tol), error_of)
    if made is None:
        return Loop(table.name, table.kind, None, problem)
    if not a.plant.motion.periodic:
        return Loop(table.name, table.kind, None, describe_end(a.plant), made, ends=True)
    if made.sample_time is not None:
        judged = a.clock.attempt(f"Floquet: {table.name}", partial(made.floquet, max(a.asked.tol, LEAST_TOL)))
        return Loop(table.name, made.kind, *judged, made)
    return judge_loop(a, table.name, table.kind, f"Floquet: {table.name}", made.closed_loop, made)


def with_response(a: Stages, loop: Loop, system: PeriodicSystem | None = None) -> Loop:
    """The loop with its periodic response to what the feedforward leaves over, where it keeps one and its states are the arm's."""
    known = loop.design.closed_loop if loop.design is not None else system
    sampled = loop.design is not None and loop.design.sample_time is not None
    if known is None or sampled or loop.verdict not in ("stable", "undecided"):
        return loop
    work = partial(find_response, a.closed, known, a.t, a.asked.tol)
    response, _ = a.clock.attempt(f"forced response: {loop.name}", work, lambda found: found.relative_error)
    return replace(loop, response=response)


def judge_sampled_loops(a: Analysis) -> tuple[Loop, ...]:
    """The loops with a feedback on the arm's own states once more, their torque sampled, held and late as the scene says."""
    sampling, found = a.scene.control.sampling, list[Loop]()
    if sampling is None:
        return ()
    for loop in (a.own, *a.designs):
        law = a.closed.law if loop.design is None else loop.design.law
        if loop.floquet is None or loop.kind == "open" or (loop.design is not None and loop.design.sample_time):
            continue
        rates = None if law.controller is None else law.controller.rates
        given = law.gain, sampling.period, sampling.delay, max(a.asked.tol, LEAST_TOL), rates
        name, work = f"{loop.name}, sampled", partial(sampled_floquet, a.plant.periodic_system(), *given)
        found.append(Loop(name, "sampled", *a.clock.attempt(f"Floquet: {name}", work)))
    return tuple(found)


def judge_estimated_loops(a: Analysis) -> tuple[Loop, ...]:
    """The designs that name sensors once more, their states estimated by a Kalman filter."""
    tables, found = {table.name: table.estimator for table in a.scene.designs}, list[Loop]()
    for loop in a.designs:
        table, made = tables[loop.name], loop.design
        if table is None or made is None:
            continue
        name = f"{loop.name}, estimated"
        work = partial(scene_sensors(a.scene, a.plant, table).filter, a.plant, a.asked.tol)
        estimator, problem = a.clock.attempt(f"estimator: {loop.name}", work, lambda known: known.error)
        if estimator is None:
            found.append(Loop(name, "lqg", None, problem))
        else:
            found.append(judge_loop(a, name, "lqg", f"Floquet: {name}", output_feedback(made, estimator)))
    return tuple(found)


def exponent_error(result: FloquetResult) -> float:
    """The largest error of a resolved exponent, in 1/s up to |exponent| = 1/s and relative beyond, as it is asked for."""
    known = np.isfinite(result.errors)
    return float((result.errors / np.maximum(1.0, np.abs(result.exponents)))[known].max(initial=0.0))


def follow_nonlinear(a: Analysis) -> None:
    """The nonlinear equations beside the linear ones: over some periods, or to the end of a motion and beyond."""
    tol, periodic = a.asked.compared_tol, a.plant.motion.periodic
    span, of = (SIMULATED_PERIODS, "periods") if periodic else (SIMULATED_DURATIONS, "durations")
    name, work = f"nonlinear simulation of {span:g} {of}", partial(simulate, a.closed, span, tol=tol)
    a.simulation = a.attempt("simulation", name, work, simulation_error, tol=tol)
    failure = a.clock.failures.get(name)
    a.stopped = failure if isinstance(failure, SimulationStopped) else None


def simulation_error(found: Simulation) -> float:
    """The larger error of both answers, the nonlinear and the linear one."""
    return max(found.error, found.linear_error)


def find_loop_margins(a: Analysis) -> None:
    """What each stable loop with a feedback endures, broken where the torque enters the arm."""
    plant = a.plant.periodic_system() if a.plant.motion.periodic and a.plant.about.m else None
    for loop in (a.own, *a.designs):
        law = a.closed.law if loop.design is None else loop.design.law
        held = loop.design is not None and loop.design.sample_time is not None
        known = loop.floquet is not None and loop.verdict == "stable" and not held
        if plant is None or not known or not np.any(law.gain(np.zeros(1))):
            continue
        broken = plant if law.controller is None else extend_system(plant, law.controller.rates)
        name = f"margins: {loop.name}"
        one = a.attempt(name, name, partial(margins, broken, law.gain), wanted=True)
        if one is not None and one.reason:
            a.clock.note(f"not all are known: {one.reason}")
        a.endured |= {} if one is None else {loop.name: one}
