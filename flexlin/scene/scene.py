"""The whole scene, with its robot file, its log, uncertain numbers, and how accurate the answers should be at what cost."""

from importlib import import_module
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from flexlin.bounds import MOST_ITEMS, printable
from flexlin.errors import ArgumentError, Problem, counted
from flexlin.plots.view import Shown, View
from flexlin.resources import CLOCK_RATIO, LIMIT_BYTES, LIMIT_SECONDS
from flexlin.scene.base import NonNegative, NotEndless, Number, Positive, Table, Text, Unit
from flexlin.scene.control import Control, DesignTable, Drives
from flexlin.scene.effects import AnyEffects
from flexlin.scene.links import FOLLOW, AnyModes, CrossSection, Link, Loop
from flexlin.scene.motion import AnyMotion
from flexlin.scene.parameters import get_value

COMPARED_TOL = 1e-6
"""The error of a report's nonlinear check where no tol is given: a thousandth of the smallest difference that such a check speaks of."""
CLOSING_SHARE, MOST_CLOSING, LEAST_CLOSING = 0.2, 30.0, 1.5
"""Share of the time that is kept for drawing and writing what was found, and its limits in s."""
MOST_UNCERTAIN = 12
"""Uncertain numbers of one scene: the search tries combinations of them."""
Sensor = Literal["coordinate", "rate", "encoder", "strain", "tip", "tip-acceleration"]


class Accuracy(Table):
    """What is asked of every stage of the work, an error, and what all of them together may take.

    tol: wanted error of each stage's answer, as the stage measures it (exponents in 1/s, relative beyond 1/s; gains, responses and
    simulations relative); seconds: time of the processor that a run may take, and so each of its stages, and by the clock as much where
    it is given; memory: bytes that a run may hold beside its libraries, which take some 200 MB, and so what a stage may ask for at once.
    """

    tol: Annotated[float, Field(strict=True, ge=1e-15, le=0.1)] = 1e-9
    """Wanted error of each stage's answer; left out, the nonlinear check of a report is asked for 1e-6."""
    seconds: Annotated[float, Field(strict=True, gt=0, le=1e7), Unit("s")] = LIMIT_SECONDS
    """Time of the processor that a run may take; given, it limits the clock too, else other programs may make it wait."""
    memory: Annotated[float, Field(strict=True, ge=2.0**20, le=2.0**50), Unit("B")] = LIMIT_BYTES
    """Memory that a run may hold beside its libraries: with these less than 1 GB."""

    @property
    def stages_end(self) -> float:
        """When all stages but the last are over, in s after the begin."""
        return self.seconds - min(CLOSING_SHARE * self.seconds, MOST_CLOSING)

    @property
    def last_end(self) -> float:
        """When everything is: after its time; where that is short, after what drawing and writing needs."""
        return max(self.seconds, self.stages_end + LEAST_CLOSING)

    @property
    def patience(self) -> float:
        """Seconds of the clock for each of the processor."""
        return 1.0 if "seconds" in self.model_fields_set else CLOCK_RATIO

    @property
    def compared_tol(self) -> float:
        """What a comparison of linear and nonlinear motion is asked for: tol if the user gave one, else COMPARED_TOL."""
        return self.tol if "tol" in self.model_fields_set else COMPARED_TOL


class RobotTable(Table):
    """A chain of a robot from a URDF file below the scene's folder."""

    urdf: Text
    """Name of the file."""
    base: Text | None = None
    """First link of the chain; by default the root."""
    tip: Text | None = None
    """Last link of the chain; by default the only end."""


class JointTable(Table):
    """What a joint has beside the URDF file: a spring, a motor behind a gear; figures are the motor's where `gear` is given."""

    stiffness: Annotated[Positive | None, Unit("N m/rad")] = None
    """Stiffness between motor and link; none for a stiff joint."""
    damping: Annotated[NonNegative, Unit("N m s/rad")] = 0.0
    """Damping between motor and link."""
    motor_inertia: Annotated[NonNegative, Unit("kg m^2")] = 0.0
    """Inertia of the motor."""
    gear: Annotated[Number, Unit("")] = 1.0
    """Turns of the motor for one of the joint."""

    @model_validator(mode="after")
    def _has_a_gear(self) -> "JointTable":
        if not self.gear:
            raise ValueError("a gear ratio that is not 0")
        return self


class FlexibleTable(Table):
    """A link that bends: what its URDF file cannot say of it."""

    length: Annotated[Positive | None, Unit("m")] = None
    """Length from its joint to the next one, unless another is given."""
    mass_per_length: Annotated[Positive | None, Unit("kg/m")] = None
    """Mass per length; by default the link's own mass, spread along it."""
    bending_stiffness: Annotated[Positive | tuple[Positive, Positive] | None, Unit("N m^2")] = None
    """Bending stiffness E I, or the pair about y and about z."""
    torsional_stiffness: Annotated[Positive | None, Unit("N m^2")] = None
    """Torsional stiffness G J."""
    polar_inertia: Annotated[Positive | None, Unit("kg m")] = None
    """Polar inertia of the sections per length, rho I_p."""
    section: CrossSection | None = None
    """Its section, in the place of mass_per_length and the stiffnesses."""
    modes: AnyModes = 0
    """Number of assumed modes, or a table of those in y, in z and of torsion."""
    mode_shapes: Literal["clamped-free", "clamped-loaded", "finite-element"] = "clamped-free"
    """The assumed modes' shapes."""

    @model_validator(mode="after")
    def _is_said_once(self) -> "FlexibleTable":
        beside = [key for key in FOLLOW if self.section is not None and getattr(self, key) is not None]
        if beside:
            raise ValueError(f"no {beside[0]} beside section, from which it follows")
        return self


class LogColumn(Table):
    """A column: the value of the scene is gain times what stands there, plus offset, and was so `delay` before the row's time."""

    column: Text
    """Its name in the head line."""
    gain: Annotated[Number, Unit("of that number, for one of the column")] = 1.0
    """Value of the scene for one unit of the column: a strain gauge's, a motor's torque for one ampere."""
    offset: Annotated[Number, Unit("of that number")] = 0.0
    """What is added."""
    delay: Annotated[NonNegative, Unit("s")] = 0.0
    """How much older the value is than the row's time says; an input acts so much later, one held between rows by half a row more."""


class LogInput(LogColumn):
    """What a joint is given; columns of one joint add up, as where one current's reading loses a share of another."""

    joint: Text | None = None
    """The joint, where the name does not say so."""


class SensorFilter(Table):
    """A filter of second order behind a sensor, z'' + 2 damping w z' + w^2 z = w^2 y with w = 2 pi frequency."""

    frequency: Annotated[Positive, Unit("Hz")]
    """Its corner."""
    damping: Annotated[Positive, Unit("")] = 1.0
    """Its damping ratio."""


class LogOutput(LogColumn):
    """A sensor. By its name it is a coordinate (q1), its rate (q1_rate), the tip's place (tip.x), or a joint's encoder."""

    sensor: Sensor | None = None
    """What it is, where the name does not say so; strain: the curvature of a link."""
    link: Annotated[int | None, Field(strict=True, ge=0, le=MOST_ITEMS)] = None
    """Number of its link or joint, from 0."""
    at: Annotated[NonNegative, Field(le=1), Unit("")] = 0.0
    """Place x/l of a strain gauge on its link."""
    lowpass: SensorFilter | None = None
    """A filter that the reading has passed, as those of strain gauges are apt to."""
    axis: Literal["x", "y", "z"] = "x"
    """World axis of the tip's place or acceleration."""


class LogTable(Table):
    """A measured log: the column of times, those of the joints' torques or forces, and those of sensors."""

    time: Text = "t"
    """Name of the column of times."""
    second: Annotated[Positive, Unit("s")] = 1.0
    """One unit of that column, such as 0.001 for milliseconds."""
    inputs: dict[str, LogInput] = Field(default_factory=dict)
    """By the name of a joint, such as q1, or as the scene names it."""
    outputs: dict[str, LogOutput] = Field(default_factory=dict)
    """By name: a coordinate, tip.x, a joint, or any name beside `sensor`."""


class Uncertain(Table):
    """A number of the scene lies between two ends, its own value among them; in the unit of that number."""

    low: Annotated[Number, Unit("of that number")]
    """Least value."""
    high: Annotated[Number, Unit("of that number")]
    """Largest value."""


def uncertainty_problems(scene: Any) -> list[Problem]:
    """Say which keys of [uncertainty] lead to no real number, and which ends are the wrong way round."""
    problems = []
    for path, ends in scene.uncertainty.items():
        key = f'uncertainty."{printable(path)}"'
        try:
            own = get_value(scene, path)
        except ArgumentError as error:
            got, expected = f"nothing at {printable(str(error.got))}", error.expected or "a key of the scene"
            problems.append(Problem(key, got, expected))
            continue
        if not isinstance(own, float):
            problems.append(Problem(key, "no real number there", "the path of one, such as effects.payload.mass"))
        elif not ends.low < ends.high:
            problems.append(Problem(key, f"{ends.low:g} to {ends.high:g}", "low below high"))
    return problems


class Scene(Shown, Table):
    """All that flexlin needs to know of an arm, its motion and its control.

    A scene is data: nothing in it is evaluated as code. Either `links` describe a chain, with `loops` a closed one, or `model` names a
    model that Python code has registered, with its `parameters`. SI units and radians everywhere.

    Attributes
    ----------
    schema_version : int
        Version of the format, 1; its key is `schema`.
    title : str
        Title in reports.
    source : str
        Where the numbers come from.
    model : str or None
        Name of a registered model.
    parameters : dict
        The registered model's own table.
    links : tuple of Link
        The links from the base on.
    loops : tuple of Loop
        Joints that close loops.
    unit_system : str
        SI, or dimensionless for a scene in units of its own; its key is `units`.
    effects : Effects
        A table for each physical effect that is on.
    motion : Harmonic, Rotation, Fourier, PointToPoint, TableMotion, LogMotion or TipPath
        The basic motion of the joints.
    control : Control
        Feedforward, feedback, saturation and sampling.
    designs : tuple of DesignTable
        Controllers to design.
    drives : Drives or None
        What the drives can give.
    uncertainty : dict of str to Uncertain
        Between which values numbers of the scene lie.
    log : LogTable or None
        Which columns of a measured log are which inputs and sensors.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> scene.links[0].length, scene.motion.kind, scene.control.feedback.kp
    (0.96, 'harmonic', (3.0,))
    """

    read_before = ("robot", "joints", "flexible")  # links from a URDF file, and what is added to them

    schema_version: Annotated[Literal[1], Field(alias="schema")]
    """Version of the format: 1."""
    title: Annotated[Text, Field(max_length=400)]
    """Title in reports."""
    source: Text = ""
    """Where the numbers come from."""
    model: Text | None = None
    """Name of a registered model, in the place of links."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The registered model's own table."""
    links: Annotated[tuple[Link, ...], NotEndless] = ()
    """The links from the base on, one [[links]] each."""
    loops: Annotated[tuple[Loop, ...], NotEndless] = ()
    """Joints that close loops, one [[loops]] each."""
    unit_system: Annotated[Literal["SI", "dimensionless"], Field(alias="units")] = "SI"
    """SI: m, kg, s; dimensionless: lengths, masses and times in units of the scene's own, and no page names any."""
    effects: AnyEffects
    """The physical effects that are on: a table each."""
    motion: AnyMotion
    """The basic motion of the joints."""
    control: Control = Control()
    """What runs on the arm: feedforward and feedback."""
    designs: Annotated[tuple[DesignTable, ...], NotEndless] = ()
    """Controllers to design and compare, one [[designs]] each."""
    drives: Drives | None = None
    """Limits of the drives: torque, speed, power, current."""
    uncertainty: dict[str, Uncertain] = Field(default_factory=dict, max_length=MOST_UNCERTAIN)
    """How well numbers of the scene are known, each by its dotted path: "effects.payload.mass" = { low = 0.0, high = 0.3 }."""
    log: LogTable | None = None
    """Which columns of a measured log are which inputs and sensors."""
    accuracy: Accuracy = Accuracy()
    """The wanted error, and what a run may cost."""

    def __repr__(self) -> str:
        return f"Scene({self.title!r}; {'; '.join(self._facts())})"

    def _view(self) -> View:
        return View(self.title, "", self._facts(), "", "", ())

    def _drawn(self) -> View:
        view: View = import_module("flexlin.motion").view_motion(self)  # it stands above this room
        return view

    def _facts(self) -> tuple[str, ...]:
        """Links, effects, motion and control in words."""
        modes = [link.modes for link in self.links]
        chain = f"{counted(len(self.links), 'link')}, modes {', '.join(map(str, modes))}"
        on = [name.replace("_", " ") for name in self.effects.on()]
        feedback = self.control.feedback
        facts = (
            f"model {self.model}" if self.model else chain,
            f"effects: {', '.join(on) or 'none'}",
            f"motion: {self.motion.kind.replace('_', ' ')}",
            f"control: {self.control.feedforward} feedforward, {'no' if feedback is None else feedback.kind} feedback",
        )
        return (*facts, f"designs: {', '.join(one.name for one in self.designs)}") if self.designs else facts
