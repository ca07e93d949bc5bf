"""All numbers of a report, from one scene."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from flexlin.about.linear import Coefficients, Linearization, linearize
from flexlin.answers.audit import Audit
from flexlin.answers.clock import Clock, Step
from flexlin.checks import Array
from flexlin.control import Design, design, linear_range, linearize_about, periodic_motion
from flexlin.control.validity import Validity
from flexlin.errors import NumericalError, TooLarge
from flexlin.mechanics import Manipulator, build_manipulator
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.modes import floquet_modes
from flexlin.periodic.floquet.resonance import Resonance, find_resonances
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.response.forced import ForcedResponse, forced_response
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.control import DesignTable
from flexlin.scene.scene import Scene
from flexlin.simulation import Simulation, simulate, tip_positions

if TYPE_CHECKING:
    import xarray

SAMPLES = 257
"""Points of a period in the figures and in report.json, both ends included."""
SIMULATED_PERIODS, SIMULATION_TOL = 3.0, 1e-6

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Loop:
    """One loop on the arm and Floquet's verdict on it; `problem` says why there is none, `design` is the designed controller, if any."""

    name: str
    kind: str
    floquet: FloquetResult | None
    problem: str = ""
    design: Design | None = None

    @property
    def verdict(self) -> str:
        """stable, unstable, undecided, or failed where no controller was found."""
        return "failed" if self.floquet is None else self.floquet.verdict

    @property
    def growth(self) -> tuple[float, float]:
        """The largest growth rate and its error, in 1/s."""
        if self.floquet is None:
            return float("nan"), float("nan")
        return float(self.floquet.exponents[0].real), float(self.floquet.errors[0])


@dataclass(frozen=True)
class Response:
    """The periodic response of the scene's own loop: states [y; y'] (N, 2n), and how far the tip is from its rigid motion, (N, 2) in m.

    `tip_by_bending` is the part of it that is left when only the elastic coordinates deviate.
    """

    solution: ForcedResponse
    states: Array
    tip: Array
    tip_by_bending: Array

    @property
    def tip_error(self) -> Array:
        """The distance of the tip from its rigid motion, (N,) in m; not a number where the model has no points."""
        return np.linalg.norm(self.tip, axis=1)


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

    @property
    def arm(self) -> Manipulator:
        """The manipulator."""
        return self.plant.arm

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Open loop, own loop (about the elastic motion too), designs; no open loop where the scene has no feedback."""
        first = () if self.own.floquet is self.open_loop.floquet else (self.open_loop,)
        elastic = () if self.elastic is None else (self.elastic,)
        return (*first, self.own, *elastic, *self.designs)


def analyse(scene: Scene, clock: Clock | None = None, tol: float = 1e-9) -> Analysis:
    """Linearize a scene's arm along its motion, judge every loop by Floquet, and compare with the nonlinear equations.

    Parameters: clock: collects the steps, and reports their progress; tol: wanted error of exponents and responses.
    Returns: an `Analysis`; a design, response or simulation that fails is a message in it.
    Raises: InputError for a scene that cannot be used; NumericalError when the scene's own loop cannot be judged.
    """
    clock = clock or Clock()
    with clock.step("equations of motion"):
        arm = build_manipulator(scene)
    with clock.step("linearization"):
        plant, closed = linearize(arm, scene.motion), linearize(arm, scene.motion, scene.control)
        system, loop = plant.periodic_system(), closed.periodic_system()
    t = np.linspace(0.0, plant.period, SAMPLES)
    with clock.step("coefficients over a period"):
        coefficients = plant.sample(t)
    own, open_loop = judge_own_loops(scene, system, loop, tol, clock)
    elastic = judge_elastic_loop(closed, tol, clock) if scene.control.about == "elastic" else None
    problems: dict[str, str] = {}
    behind = find_causes(own, loop, problems, clock)
    with clock.step("forced response"):
        response = attempt(problems, "response", lambda: find_response(closed, loop, t, tol))
    with clock.step(f"nonlinear simulation of {SIMULATED_PERIODS:g} periods"):
        simulation = attempt(problems, "simulation", lambda: simulate(closed, SIMULATED_PERIODS, tol=SIMULATION_TOL))
    with clock.step("range of the linear equations"):
        linear = attempt(problems, "linear range", lambda: linear_range(closed, result=own.floquet))
    designs = tuple(design_and_judge(system, table, tol, clock) for table in scene.designs)
    found = (coefficients, own, open_loop, designs, response, simulation, problems, tuple(clock.steps))
    return Analysis(scene, plant, closed, t, *found, resonances=behind, elastic=elastic, linear_range=linear)


def plant_and_designs(scene: Scene, clock: Clock, tol: float = 1e-9) -> tuple[Linearization, tuple[Loop, ...]]:
    """The open-loop linearization of a scene, and its designs with their verdicts."""
    with clock.step("linearization"):
        plant = linearize(build_manipulator(scene), scene.motion)
        system = plant.periodic_system()
    return plant, tuple(design_and_judge(system, table, tol, clock) for table in scene.designs)


def judge_own_loops(
    scene: Scene, system: PeriodicSystem, loop: PeriodicSystem, tol: float, clock: Clock
) -> tuple[Loop, Loop]:
    """The scene's own loop and the open loop; one result for both where the scene has no feedback."""
    feedback = scene.control.feedback
    with clock.step("Floquet: open loop" if feedback is None else "Floquet: the scene's loop"):
        result = floquet(loop, tol)
    if feedback is None:
        return Loop("no feedback", "open", result), Loop("open loop", "open", result)
    with clock.step("Floquet: open loop"):
        open_loop = judge_loop("open loop", "open", system, tol)
    return Loop(f"scene's {feedback.kind.upper()}", feedback.kind, result), open_loop


def judge_elastic_loop(closed: Linearization, tol: float, clock: Clock) -> Loop:
    """The scene's own loop, linearized about the periodic motion of the elastic arm in the place of the rigid one."""
    name, problems = "about elastic motion", dict[str, str]()
    with clock.step("periodic motion of the elastic arm"):
        motion = attempt(problems, name, lambda: periodic_motion(closed))
    if motion is None:
        return Loop(name, "elastic", None, problems[name])
    with clock.step("Floquet: about the elastic motion"):
        return judge_loop(name, "elastic", linearize_about(motion), tol)


def find_causes(own: Loop, system: PeriodicSystem, problems: dict[str, str], clock: Clock) -> tuple[Resonance, ...]:
    """The parametric resonances behind an unstable own loop."""
    if own.verdict != "unstable":
        return ()
    with clock.step("cause of the instability"):
        found = attempt(problems, "resonances", lambda: find_resonances(system, floquet_modes(system, own.floquet)))
    return tuple(found or ())


def judge_loop(name: str, kind: str, system: PeriodicSystem, tol: float, made: Design | None = None) -> Loop:
    """Floquet's verdict on a loop beside the scene's own, or why there is none."""
    problems: dict[str, str] = {}
    result = attempt(problems, name, lambda: floquet(system, tol))
    return Loop(name, kind, result, problems.get(name, ""), made)


def design_and_judge(system: PeriodicSystem, table: DesignTable, tol: float, clock: Clock) -> Loop:
    """A designed controller with the verdict on its closed loop."""
    problems: dict[str, str] = {}
    with clock.step(f"design: {table.name}"):
        made = attempt(problems, table.name, lambda: design(system, table))
    if made is None:
        return Loop(table.name, table.kind, None, problems[table.name])
    with clock.step(f"Floquet: {table.name}"):
        return judge_loop(table.name, table.kind, made.closed_loop, tol, made)


def find_response(closed: Linearization, loop: PeriodicSystem, t: Array, tol: float) -> Response:
    """The periodic response to what the rigid motion leaves over, and what it does to the tip."""
    solution = forced_response(loop, closed.forcing, tol)
    states = solution(t)
    bent = states * [coordinate.kind == "elastic" for coordinate in closed.coordinates * 2]
    rigid = tip_positions(closed, t, np.zeros_like(states))
    tip, by_bending = (tip_positions(closed, t, x) - rigid for x in (states, bent))
    return Response(solution, states, tip, by_bending)


def attempt(problems: dict[str, str], name: str, work: Callable[[], Answer]) -> Answer | None:
    """Do the work; where it has no trustworthy answer, note why and return nothing."""
    try:
        return work()
    except (NumericalError, TooLarge) as error:
        problems[name] = str(error)
        return None
