"""The whole scene."""

from typing import Annotated, Any, Literal

from pydantic import Field

from flexlin.scene.accuracy import Accuracy
from flexlin.scene.base import NotEndless, Table, Text
from flexlin.scene.control import Control, DesignTable
from flexlin.scene.effects import AnyEffects
from flexlin.scene.links import Link
from flexlin.scene.motion import AnyMotion


class Scene(Table):
    """All that flexlin needs to know of an arm, its motion and its control. A scene is data: nothing in it is evaluated as code.

    Either `links` describe a planar chain, or `model` names a model that Python code has registered, with its `parameters`.
    SI units and radians everywhere.
    """

    schema_version: Annotated[Literal[1], Field(alias="schema")]
    title: Text
    source: Text = ""
    model: Text | None = None
    parameters: dict[str, Any] = Field(default_factory=dict)
    links: Annotated[tuple[Link, ...], NotEndless] = ()
    effects: AnyEffects
    motion: AnyMotion
    control: Control = Control()
    designs: Annotated[tuple[DesignTable, ...], NotEndless] = ()
    accuracy: Accuracy = Accuracy()
