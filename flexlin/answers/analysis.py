"""All numbers of a report, from one scene."""

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.linear import Coefficients, Linearization, linearize
from flexlin.answers.audit import Audit
from flexlin.answers.clock import Clock, Step
from flexlin.answers.steady import Response, arm_length, find_response, response_error
from flexlin.answers.validity import ModelValidity, judge_model
from flexlin.checks import Array
from flexlin.control import Design, design, linear_range, linearize_about, periodic_motion
from flexlin.control.validity import Validity
from flexlin.errors import SimulationStopped
from flexlin.mechanics import Manipulator, build_manipulator
from flexlin.periodic.certificate.lyapunov import Certificate
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.resonance import Resonance, find_resonances
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.accuracy import Accuracy
from flexlin.scene.control import DesignTable
from flexlin.scene.scene import Scene
from flexlin.simulation import Simulation, simulate

if TYPE_CHECKING:
    import xarray

SAMPLES = 257
"""Points of a period in the figures and in report.json, both ends included."""
SIMULATED_PERIODS = 3.0
RANGE = 1e-4
"""Relative width to which the range of the linear equations is found: three digits are printed, and times are sampled."""
BY_TOL = ("periodic-lqr", "finite-horizon-lqr")
"""Designs whose gain has an error that can be asked for."""


@dataclass(frozen=True)
class Loop:
    """One loop on the arm and Floquet's verdict on it; `problem` says why there is none, `design` is the designed controller, if any,
    `response` the loop's periodic response, if that is known and kept: an unstable loop leaves it,
    `certificate` the proof that it is stable."""

    name: str
    kind: str
    floquet: FloquetResult | None
    problem: str = ""
    design: Design | None = None
    response: Response | None = None
    certificate: Certificate | None = None

    @property
    def verdict(self) -> str:
        """stable, unstable, undecided, or failed where there is no answer."""
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


@dataclass(frozen=True)
class Analysis:
    """What a report says: `own` is the scene's own loop, `open_loop` the arm without feedback; `problems` says what is missing,
    `resonances` what is behind an unstable own loop, `audit` and `sensitivity` which effects and numbers matter, if that was asked for,
    `elastic` the own loop about the elastic motion, if the scene asks for it, `linear_range` how far the linear equations hold.
    """

    scene: Scene
    plant: Linearization
    closed: Linearization
    t: Array
    coefficients: Coefficients
    own: Loop
    open_loop: Loop
    designs: tuple[Loop, ...]
    response: Response | None
    simulation: Simulation | None
    problems: dict[str, str]
    steps: tuple[Step, ...]
    resonances: tuple[Resonance, ...] = ()
    audit: Audit | None = None
    sensitivity: "xarray.Dataset | None" = None
    elastic: Loop | None = None
    linear_range: Validity | None = None
    stopped: SimulationStopped | None = None

    def validity(self, loop: Loop) -> ModelValidity:
        """Whether the linear model can be believed along the motion under one of the loops; only the own loop is simulated."""
        if loop is not self.own:
            return judge_model(self.length, loop.steady)
        run, end = self.simulation, self.stopped
        simulated = None if run is None else (*run.apart[1:], run.unit.strip())
        ended = None if end is None or not end.left_range else (end.t, SIMULATED_PERIODS * self.plant.period)
        return judge_model(self.length, replace(loop, response=self.response).steady, simulated, ended)

    @property
    def length(self) -> float:
        """The length of the arm, in m; not a number where it has no points."""
        return arm_length(self.plant)

    @property
    def arm(self) -> Manipulator:
        """The manipulator."""
        return self.plant.arm

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Open loop, own loop (about the elastic motion too), designs; no open loop where the scene has no feedback."""
        first = () if self.own.kind == "open" else (self.open_loop,)
        elastic = () if self.elastic is None else (self.elastic,)
        return (*first, self.own, *elastic, *self.designs)


def analyse(scene: Scene, clock: Clock | None = None) -> Analysis:
    """Linearize a scene's arm along its motion, judge every loop by Floquet, and compare with the nonlinear equations.

    Every stage is asked for `scene.accuracy.tol` and kept within the limits that stand beside it; where no tol is given the nonlinear
    check is asked for what its comparison needs.

    Parameters: clock: collects the steps, and reports their progress.
    Returns: an `Analysis`; a stage that fails or meets a limit is a message in it.
    Raises: InputError for a scene that cannot be used; NumericalError when there are no linear equations.
    """
    clock, asked, problems = clock or Clock(), scene.accuracy, dict[str, str]()
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant, closed = linearize_both(arm, scene, clock)
    system, loop = plant.periodic_system(), closed.periodic_system()
    t = np.linspace(0.0, plant.period, SAMPLES)
    coefficients = clock.stage("coefficients over a period", asked, lambda: plant.sample(t))
    own, open_loop = judge_own_loops(scene, system, loop, clock)
    elastic = judge_elastic_loop(closed, asked, clock) if scene.control.about == "elastic" else None
    behind = find_causes(own, loop, problems, asked, clock)
    response = clock.attempt(
        problems,
        "response",
        "forced response",
        asked,
        lambda: find_response(closed, loop, t, asked.tol),
        response_error,
    )
    simulation = clock.attempt(
        problems,
        "simulation",
        f"nonlinear simulation of {SIMULATED_PERIODS:g} periods",
        asked.of_comparison,
        lambda: simulate(closed, SIMULATED_PERIODS, tol=asked.of_comparison.tol),
        simulation_error,
    )
    failure = clock.failures.get("simulation")
    ended = failure if isinstance(failure, SimulationStopped) else None
    linear = range_of(closed, own, problems, asked, clock)
    designs = design_all(scene, plant, closed, t, clock)
    bare = replace(own, name="open loop", response=response)
    open_loop = bare if own.kind == "open" else with_response(open_loop, closed, t, asked, clock, system)
    found = (coefficients, own, open_loop, designs, response, simulation, problems, tuple(clock.steps))
    return Analysis(
        scene, plant, closed, t, *found, resonances=behind, elastic=elastic, linear_range=linear, stopped=ended
    )


def plant_and_designs(scene: Scene, clock: Clock) -> tuple[Linearization, tuple[Loop, ...]]:
    """The open-loop linearization of a scene, and its designs with their verdicts, as accurate as the scene asks."""
    asked = scene.accuracy
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant, closed = linearize_both(arm, scene, clock)
    t = np.linspace(0.0, plant.period, SAMPLES)
    return plant, design_all(scene, plant, closed, t, clock)


def linearize_both(arm: Manipulator, scene: Scene, clock: Clock) -> tuple[Linearization, Linearization]:
    """The arm alone, and with the scene's own loop."""
    return clock.stage(
        "linearization",
        scene.accuracy,
        lambda: (linearize(arm, scene.motion), linearize(arm, scene.motion, scene.control)),
    )


def design_all(scene: Scene, plant: Linearization, closed: Linearization, t: Array, clock: Clock) -> tuple[Loop, ...]:
    """The scene's designs with their verdicts and the steady motions that they keep."""
    asked = scene.accuracy
    return tuple(
        with_response(design_and_judge(plant, table, asked, clock), closed, t, asked, clock) for table in scene.designs
    )


def judge_own_loops(scene: Scene, system: PeriodicSystem, loop: PeriodicSystem, clock: Clock) -> tuple[Loop, Loop]:
    """The scene's own loop and the open loop; one result for both where the scene has no feedback."""
    feedback, asked = scene.control.feedback, scene.accuracy
    if feedback is None:
        own = judge_loop("no feedback", "open", "Floquet: open loop", loop, asked, clock)
        return own, replace(own, name="open loop")
    kind = feedback.kind
    own = judge_loop(f"scene's {kind.upper()}", kind, "Floquet: the scene's loop", loop, asked, clock)
    return own, judge_loop("open loop", "open", "Floquet: open loop", system, asked, clock)


def judge_elastic_loop(closed: Linearization, asked: Accuracy, clock: Clock) -> Loop:
    """The scene's own loop, linearized about the periodic motion of the elastic arm in the place of the rigid one."""
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


def find_causes(
    own: Loop, system: PeriodicSystem, problems: dict[str, str], asked: Accuracy, clock: Clock
) -> tuple[Resonance, ...]:
    """The parametric resonances behind an unstable own loop."""
    if own.floquet is None or own.verdict != "unstable":
        return ()
    result = own.floquet
    found = clock.attempt(
        problems,
        "resonances",
        "cause of the instability",
        asked,
        lambda: find_resonances(system, floquet_modes(system, result)),
    )
    return tuple(found or ())


def range_of(
    closed: Linearization, own: Loop, problems: dict[str, str], asked: Accuracy, clock: Clock
) -> Validity | None:
    """How far the linear equations of the own loop hold; it is measured along the loop's Floquet modes."""
    if own.floquet is None:
        problems["linear range"] = "there are no Floquet modes to measure it along"
        return None
    name = "range of the linear equations"
    work = partial(linear_range, closed, result=own.floquet, tol=max(RANGE, asked.tol))
    return clock.attempt(problems, "linear range", name, asked, work)


def judge_loop(
    name: str, kind: str, step: str, system: PeriodicSystem, asked: Accuracy, clock: Clock, made: Design | None = None
) -> Loop:
    """Floquet's verdict on a loop, or why there is none."""
    problems: dict[str, str] = {}
    result = clock.attempt(problems, name, step, asked, lambda: floquet(system, asked.tol), exponent_error)
    proof = None
    if result is not None and result.verdict == "stable":
        proof = clock.attempt(dict[str, str](), name, f"certificate: {name}", asked, result.certificate)
    return Loop(name, kind, result, problems.get(name, ""), made, certificate=proof)


def design_and_judge(plant: Linearization, table: DesignTable, asked: Accuracy, clock: Clock) -> Loop:
    """A designed controller with the verdict on its closed loop."""
    problems: dict[str, str] = {}
    error_of = (lambda made: float(made.error)) if table.kind in BY_TOL else None
    work = partial(design, plant, table, asked.tol)
    made = clock.attempt(problems, table.name, f"design: {table.name}", asked, work, error_of)
    if made is None:
        return Loop(table.name, table.kind, None, problems[table.name])
    return judge_loop(table.name, table.kind, f"Floquet: {table.name}", made.closed_loop, asked, clock, made)


def with_response(
    loop: Loop, closed: Linearization, t: Array, asked: Accuracy, clock: Clock, system: PeriodicSystem | None = None
) -> Loop:
    """The loop with its periodic response to what the feedforward leaves over, where it keeps one and its states are the arm's."""
    system = loop.design.closed_loop if loop.design is not None else system
    if system is None or loop.verdict not in ("stable", "undecided") or system.n != 2 * closed.n:
        return loop
    name, problems, known = f"forced response: {loop.name}", dict[str, str](), system
    found = clock.attempt(
        problems, name, name, asked, lambda: find_response(closed, known, t, asked.tol), response_error
    )
    return replace(loop, response=found)


def exponent_error(result: FloquetResult) -> float:
    """The largest error of a resolved exponent, in 1/s up to |exponent| = 1/s and relative beyond, as it is asked for."""
    known = np.isfinite(result.errors)
    return float((result.errors / np.maximum(1.0, np.abs(result.exponents)))[known].max(initial=0.0))


def simulation_error(found: Simulation) -> float:
    """The larger error of the nonlinear and the linear states, relative to the largest, absolute below 1."""
    return max(found.error, found.linear_error)
