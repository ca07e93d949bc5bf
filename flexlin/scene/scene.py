"""The whole scene, with what is known of its numbers only between limits."""

from typing import Annotated, Any, Literal

from pydantic import Field

from flexlin.errors import ArgumentError, Problem
from flexlin.scene.accuracy import Accuracy
from flexlin.scene.base import NotEndless, Number, Table, Text, Unit
from flexlin.scene.control import Control, DesignTable, Drives
from flexlin.scene.effects import AnyEffects
from flexlin.scene.links import Link, Loop
from flexlin.scene.motion import AnyMotion
from flexlin.scene.parameters import get_value
from flexlin.text import printable

MOST = 12
"""Uncertain numbers of one scene: the search tries combinations of them."""


class Uncertain(Table):
    """A number of the scene lies between two ends, its own value among them; in the unit of that number."""

    low: Annotated[Number, Unit("of that number")]
    """Least value."""
    high: Annotated[Number, Unit("of that number")]
    """Largest value."""


def uncertainty_problems(scene: Any) -> list[Problem]:
    """Say which keys of [uncertainty] lead to no real number, and which ends are the wrong way round."""
    problems = []
    if len(scene.uncertainty) > MOST:
        problems.append(Problem("uncertainty", f"{len(scene.uncertainty)} numbers", f"{MOST} at most"))
    for path, ends in scene.uncertainty.items():
        key = f'uncertainty."{printable(path)}"'
        try:
            own = get_value(scene, path)
        except ArgumentError as error:
            problems.append(
                Problem(key, f"nothing at {printable(str(error.got))}", error.expected or "a key of the scene")
            )
            continue
        if not isinstance(own, float):
            problems.append(Problem(key, "no real number there", "the path of one, such as effects.payload.mass"))
        elif not ends.low < ends.high:
            problems.append(Problem(key, f"{ends.low:g} to {ends.high:g}", "low below high"))
    return problems


class Scene(Table):
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
    motion : Harmonic, Rotation, Fourier, PointToPoint, TableMotion or TipPath
        The basic motion of the joints.
    control : Control
        Feedforward, feedback, saturation and sampling.
    designs : tuple of DesignTable
        Controllers to design.
    drives : Drives or None
        What the drives can give.
    uncertainty : dict of str to Uncertain
        Between which values numbers of the scene lie.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> scene.links[0].length, scene.motion.kind, scene.control.feedback.kp
    (0.96, 'harmonic', (3.0,))
    """

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
    uncertainty: dict[str, Uncertain] = Field(default_factory=dict)
    """How well numbers of the scene are known, each by its dotted path: "effects.payload.mass" = { low = 0.0, high = 0.3 }."""
    accuracy: Accuracy = Accuracy()
    """The wanted error, and what a run may cost."""
