"""The tables of a path of the tip: circles, and straight lines between waypoints with blends."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from flexlin.scene.base import NonNegative, Positive, Table, Unit
from flexlin.scene.space import Axis, Vector


class Circle(Table):
    """A circle at constant speed, counterclockwise about its normal."""

    kind: Literal["circle"]
    """The kind of path."""
    centre: Annotated[Vector, Unit("m")]
    """Its centre."""
    radius: Annotated[Positive, Unit("m")]
    """Its radius."""
    normal: Axis = (0.0, 0.0, 1.0)
    """Direction about which it turns."""
    period: Annotated[Positive, Unit("s")]
    """Time once round."""
    rpy: Annotated[Vector | None, Unit("rad")] = None
    """Roll, pitch and yaw of the tip on the way; none where only its position is led."""


class Polyline(Table):
    """Straight lines from waypoint to waypoint and back to the first; two of them make a line there and back.

    Each move begins `blend_time` before the one before it ends, and so cuts the corner smoothly.
    """

    kind: Literal["polyline"]
    """The kind of path."""
    points: Annotated[tuple[Vector, ...], Field(min_length=2, max_length=100), Unit("m")]
    """The waypoints, in this order."""
    move_time: Annotated[Positive, Unit("s")]
    """Time from one waypoint to the next."""
    dwell_time: Annotated[NonNegative, Unit("s")] = 0.0
    """Time of rest at each waypoint."""
    blend_time: Annotated[NonNegative, Unit("s")] = 0.0
    """Time for which a move and the next one overlap; half of move_time at most."""
    profile: Literal["quintic", "septic"] = "quintic"
    """The polynomial of each move."""
    rpy: Annotated[tuple[Vector, ...], Unit("rad")] = ()
    """Roll, pitch and yaw of the tip, one triple for all waypoints or one each; none where only its position is led."""

    @model_validator(mode="after")
    def _fits(self) -> "Polyline":
        if self.blend_time and (self.blend_time > self.move_time / 2 or self.dwell_time):
            raise ValueError("a blend_time of half the move_time at most, and none beside a dwell_time")
        if len(self.rpy) not in (0, 1, len(self.points)):
            raise ValueError("no rpy, one for all points or one each")
        return self


AnyPath = Annotated[Circle | Polyline, Field(discriminator="kind")]
