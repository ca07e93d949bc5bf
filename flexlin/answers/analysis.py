"""All numbers of a report, from one scene."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.linear import Coefficients, linearize, with_control
from flexlin.about.linearization import Linearization
from flexlin.answers.clock import Clock, Step
from flexlin.answers.judging import (
    Loop,
    describe_end,
    design_and_judge,
    judge_elastic_loop,
    judge_estimated_loops,
    judge_own_loops,
    judge_sampled_loops,
    load_of,
    name_ending_loops,
    with_response,
)
from flexlin.answers.loops import can_stay_free
from flexlin.answers.margins import Margin
from flexlin.answers.steady import Response, arm_length, find_response, response_error
from flexlin.answers.validity import ModelValidity, judge_model
from flexlin.checks import Array
from flexlin.control.drives import DriveLoad, drive_load
from flexlin.control.measurement import tip_zeros
from flexlin.control.validity import Validity, linear_range
from flexlin.errors import InputError, SimulationStopped
from flexlin.mechanics import Manipulator, build_manipulator
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.margins import Margins, margins
from flexlin.periodic.related import extend_system
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.zeros import InvariantZeros
from flexlin.scene.accuracy import Accuracy
from flexlin.scene.scene import Scene
from flexlin.simulation.result import Simulation
from flexlin.simulation.run import simulate

if TYPE_CHECKING:
    import xarray

    from flexlin.answers.audit.result import Audit
    from flexlin.answers.nearest.instability import NearestInstability
    from flexlin.periodic.floquet.resonance import Resonance
    from flexlin.periodic.margins import Margins


SAMPLES = 257
"""Points of a period in the figures and in report.json, both ends included."""
SIMULATED_PERIODS = 3.0
BEYOND = 1.5
"""Durations of a one-way motion that are simulated: it rests after its end."""
RANGE = 1e-4
"""Relative width to which the range of the linear equations is found: three digits are printed, and times are sampled."""


@dataclass(frozen=True)
class Analysis:
    """What a report says: `own` is the scene's own loop, `open_loop` the arm without feedback; `problems` says what is missing,
    `resonances` what is behind an unstable own loop, `audit` and `sensitivity` which effects and numbers matter, if that was asked for,
    `elastic` the own loop about the elastic motion, if the scene asks for it, `linear_range` how far the linear equations hold,
    `sampled` the loops again, with their torque sampled and held, where the scene has [control.sampling], `estimated` the designs
    with sensors again, with their states estimated, `endured` the margins of loops by their names, if they were asked for, `nearest` the
    smallest change of the numbers of [uncertainty] that makes the own loop unstable, `zeros` those from the motors to the tip.
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
    resonances: "tuple[Resonance, ...]" = ()
    audit: "Audit | None" = None
    sensitivity: "xarray.Dataset | None" = None
    elastic: Loop | None = None
    linear_range: Validity | None = None
    stopped: SimulationStopped | None = None
    sampled: tuple[Loop, ...] = ()
    estimated: tuple[Loop, ...] = ()
    margins: tuple[Margin, ...] = ()
    endured: "Mapping[str, Margins]" = field(default_factory=dict)
    nearest: "NearestInstability | None" = None
    zeros: InvariantZeros | None = None

    def validity(self, loop: Loop) -> ModelValidity:
        """Whether the linear model can be believed along the motion under one of the loops; only the own loop is simulated."""
        if loop is not self.own:
            return judge_model(self.length, loop.steady)
        run, end = self.simulation, self.stopped
        simulated = None if run is None else (*run.apart[1:], run.unit.strip())
        ended = None if end is None or not end.left_range else (end.t, SIMULATED_PERIODS * self.plant.period)
        curved = self.plant.arm.near is not self.plant.arm
        return judge_model(self.length, replace(loop, response=self.response).steady, simulated, ended, curved)

    def load(self, loop: Loop) -> DriveLoad | None:
        """What the drives have to do in the steady motion that a loop keeps, where that is known."""
        known = replace(loop, response=self.response) if loop is self.own else loop
        return load_of(known, self.plant, self.closed, self.t, self.scene.drives)

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
    clock, asked, problems = clock or Clock(), scene.accuracy, dict[str, str]()
    arm = clock.stage("equations of motion", asked, lambda: build_with_free(scene, free))
    plant, closed = linearize_both(arm, scene, clock)
    t = np.linspace(0.0, plant.period, SAMPLES)
    coefficients = clock.stage("coefficients over a period", asked, lambda: plant.sample(t))
    if not plant.motion.periodic:
        return analyse_one_way(scene, plant, closed, t, coefficients, clock)
    system, loop = plant.periodic_system(), closed.periodic_system()
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
    linear = range_of(plant, closed, own, problems, asked, clock)
    zeros = find_zeros(plant, problems, asked, clock)
    designs = design_all(scene, plant, closed, t, clock)
    sampled = judge_sampled_loops(scene, (own, *designs), plant, closed, clock)
    estimated = judge_estimated_loops(scene, designs, plant, clock)
    bare = replace(own, name="open loop", response=response)
    open_loop = bare if own.kind == "open" else with_response(open_loop, closed, t, asked, clock, system)
    found = (coefficients, own, open_loop, designs, response, simulation, problems, tuple(clock.steps))
    answer = Analysis(scene, plant, closed, t, *found, resonances=behind, elastic=elastic, linear_range=linear)
    return replace(answer, stopped=ended, sampled=sampled, estimated=estimated, zeros=zeros)


def analyse_one_way(
    scene: Scene, plant: Linearization, closed: Linearization, t: Array, coefficients: Coefficients, clock: Clock
) -> Analysis:
    """What can be said of a motion that ends: its coefficients, its designs, and the simulation to its end and beyond."""
    asked, problems = scene.accuracy.of_comparison, {key: describe_end(plant) for key in ("response", "linear range")}
    own, open_loop = name_ending_loops(scene, plant)
    name = f"nonlinear simulation of {BEYOND:g} durations"
    work = partial(simulate, closed, BEYOND, tol=asked.tol)
    simulation = clock.attempt(problems, "simulation", name, asked, work, simulation_error)
    failure = clock.failures.get("simulation")
    designs = design_all(scene, plant, closed, t, clock)
    found = (coefficients, own, open_loop, designs, None, simulation, problems, tuple(clock.steps))
    stopped = failure if isinstance(failure, SimulationStopped) else None
    return Analysis(scene, plant, closed, t, *found, stopped=stopped)


def plant_and_designs(scene: Scene, clock: Clock) -> tuple[Linearization, tuple[Loop, ...]]:
    """The open-loop linearization of a scene, and its designs with their verdicts, as accurate as the scene asks."""
    asked = scene.accuracy
    arm = clock.stage("equations of motion", asked, lambda: build_manipulator(scene))
    plant, closed = linearize_both(arm, scene, clock)
    t = np.linspace(0.0, plant.period, SAMPLES)
    return plant, design_all(scene, plant, closed, t, clock)


def build_with_free(scene: Scene, free: Sequence[str]) -> Manipulator:
    """The manipulator, with numbers left free where all of them can be."""
    if free and can_stay_free(scene, free):
        with suppress(InputError):
            return build_manipulator(scene, free)
    return build_manipulator(scene)


def linearize_both(arm: Manipulator, scene: Scene, clock: Clock) -> tuple[Linearization, Linearization]:
    """The arm alone, and with the scene's own loop; limits of the drives that do not fit are refused before any other work."""

    def work() -> tuple[Linearization, Linearization]:
        plant = linearize(arm, scene.motion)
        closed = with_control(plant, scene.control)
        drive_load(plant, np.zeros(1), np.zeros((1, 2 * plant.n)), plant.law, scene.drives)
        return plant, closed

    return clock.stage("linearization", scene.accuracy, work)


def design_all(scene: Scene, plant: Linearization, closed: Linearization, t: Array, clock: Clock) -> tuple[Loop, ...]:
    """The scene's designs with their verdicts and the steady motions that they keep."""
    asked = scene.accuracy
    return tuple(
        with_response(design_and_judge(plant, table, asked, clock), closed, t, asked, clock) for table in scene.designs
    )


def find_causes(
    own: Loop, system: PeriodicSystem, problems: dict[str, str], asked: Accuracy, clock: Clock
) -> "tuple[Resonance, ...]":
    """The parametric resonances behind an unstable own loop."""
    if own.floquet is None or own.verdict != "unstable":
        return ()
    from flexlin.periodic.floquet.resonance import find_resonances

    result = own.floquet
    found = clock.attempt(
        problems,
        "resonances",
        "cause of the instability",
        asked,
        lambda: find_resonances(system, floquet_modes(system, result)),
    )
    return tuple(found or ())


def find_zeros(plant: Linearization, problems: dict[str, str], asked: Accuracy, clock: Clock) -> InvariantZeros | None:
    """The invariant zeros of tip control, where the motors move the tip in as many directions as they are."""
    inputs = len(plant.driven)
    if not 0 < inputs <= 2 or plant.n == inputs or plant.arm.points is None:
        return None
    return clock.attempt(problems, "zeros", "zeros of tip control", asked, partial(tip_zeros, plant, asked.tol))


def range_of(
    plant: Linearization, closed: Linearization, own: Loop, problems: dict[str, str], asked: Accuracy, clock: Clock
) -> Validity | None:
    """How far the linear equations of the own loop hold; it is measured along the loop's Floquet modes."""
    if own.floquet is None:
        problems["linear range"] = "there are no Floquet modes to measure it along"
        return None
    name = "range of the linear equations"
    work = partial(linear_range, closed, result=own.floquet, tol=max(RANGE, asked.tol), plant=plant)
    return clock.attempt(problems, "linear range", name, asked, work)


def simulation_error(found: Simulation) -> float:
    """The larger error of the nonlinear and the linear states, relative to the largest, absolute below 1."""
    return max(found.error, found.linear_error)


def find_loop_margins(a: Analysis, clock: Clock) -> dict[str, Margins]:
    """What each stable loop with a feedback endures, broken where the torque enters the arm, by the loop's name."""
    found: dict[str, Margins] = {}
    plant = a.plant.periodic_system() if a.plant.motion.periodic and a.plant.about.m else None
    for loop in (a.own, *a.designs):
        law = a.closed.law if loop.design is None else loop.design.law
        known = loop.floquet is not None and loop.verdict == "stable"
        if plant is None or not known or not np.any(law.gain(np.zeros(1))):
            continue
        broken = plant if law.controller is None else extend_system(plant, law.controller.rates)
        name = f"margins: {loop.name}"
        one = clock.attempt(a.problems, name, name, a.scene.accuracy, partial(margins, broken, law.gain))
        if one is not None and one.reason:
            a.problems[name] = f"some of the {name}: {one.reason}"
        found |= {} if one is None else {loop.name: one}
    return found
