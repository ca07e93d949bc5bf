"""The tables of the basic motions: one table a joint in `joints`, or a path of the tip."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from flexlin.scene.base import NonNegative, Number, Positive, Table, Text, Unit
from flexlin.scene.links import Axis, Vector


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


Drive = Literal["torque", "prescribed"]


class Joint(Table):
    """A joint is driven by torque, or its angle is a prescribed function of time and no coordinate."""

    drive: Drive | None = None
    """torque: the joint has a motor; prescribed: its motion is given and it is no coordinate."""


class HarmonicJoint(Joint):
    mean: Annotated[Number, Unit("rad or m")] = 0.0
    """Middle of the motion."""
    amplitude: Annotated[Number, Unit("rad or m")]
    """Largest distance from the middle."""
    phase: Annotated[Number, Unit("rad")] = 0.0
    """Phase at t = 0."""


class RotationJoint(Joint):
    start: Annotated[Number, Unit("rad or m")] = 0.0
    """Where it is at t = 0."""
    rate: Annotated[Number, Unit("rad/s or m/s")]
    """Constant rate."""


class FourierJoint(Joint):
    mean: Annotated[Number, Unit("rad or m")] = 0.0
    """Mean over a period."""
    cos: Annotated[tuple[Number, ...], Unit("rad or m")] = ()
    """Coefficients of cos(2 pi k t/T), k = 1, 2 ..."""
    sin: Annotated[tuple[Number, ...], Unit("rad or m")] = ()
    """Coefficients of sin(2 pi k t/T), k = 1, 2 ..."""


class PointToPointJoint(Joint):
    waypoints: Annotated[tuple[Number, ...], Field(min_length=2), Unit("rad or m")]
    """Where the joint rests, in this order."""


class MotionTable(Table):
    """What all motions share: `drive` is the default of the joints."""

    drive: Drive = "torque"
    """What moves the joints that do not say so themselves."""


class Harmonic(MotionTable):
    """q = mean + amplitude sin(2 pi f t + phase)."""

    kind: Literal["harmonic"]
    """The kind of motion."""
    frequency: Annotated[Positive, Unit("Hz")]
    """Periods in a second."""
    joints: Annotated[tuple[HarmonicJoint, ...], Field(min_length=1)]
    """One table a joint."""


class Rotation(MotionTable):
    """q = start + rate t."""

    kind: Literal["rotation"]
    """The kind of motion."""
    joints: Annotated[tuple[RotationJoint, ...], Field(min_length=1)]
    """One table a joint."""


class Fourier(MotionTable):
    """q = mean + sum_k cos_k cos(2 pi k t/T) + sin_k sin(2 pi k t/T)."""

    kind: Literal["fourier"]
    """The kind of motion."""
    period: Annotated[Positive, Unit("s")]
    """Length of a period."""
    joints: Annotated[tuple[FourierJoint, ...], Field(min_length=1)]
    """One table a joint."""


class PointToPoint(MotionTable):
    """Rest at each waypoint, move between them along a smooth polynomial.

    `course = "there-and-back"` retraces the waypoints and is periodic; `"one-way"` is a finite horizon.
    """

    kind: Literal["point-to-point"]
    """The kind of motion."""
    move_time: Annotated[Positive, Unit("s")]
    """Time from one waypoint to the next."""
    dwell_time: Annotated[NonNegative, Unit("s")] = 0.0
    """Time of rest at each waypoint."""
    profile: Literal["quintic", "septic"] = "quintic"
    """The polynomial of each move."""
    course: Literal["there-and-back", "one-way"] = "there-and-back"
    """there-and-back is periodic; one-way ends at the last waypoint."""
    joints: Annotated[tuple[PointToPointJoint, ...], Field(min_length=1)]
    """One table a joint."""


class TableMotion(MotionTable):
    """Samples t, q1, q2 ... over one period in a CSV file, joined by a periodic quintic spline."""

    kind: Literal["table"]
    """The kind of motion."""
    file: Text
    """CSV file with samples t, q1, q2 ... of one period (s; rad or m), seen from the scene's folder."""
    joints: tuple[Joint, ...] = ()
    """One table a joint, where one says what drives it."""


class LogMotion(MotionTable):
    """Cycles of a measured log in a CSV file with a head line, averaged: a Fourier series up to the harmonics that its noise allows."""

    kind: Literal["log"]
    """The kind of motion."""
    file: Text
    """The CSV file, seen from the scene's folder."""
    time: Text = "t"
    """Name of the column of times in s."""
    columns: Annotated[tuple[Text, ...], Field(min_length=1), Unit("rad or m")]
    """Names of the columns of angles, one a joint."""
    period: Annotated[Positive | None, Unit("s")] = None
    """Length of a cycle, where it shall not be found."""
    harmonics: Annotated[int | None, Field(strict=True, ge=1, le=60)] = None
    """Highest harmonic, where it shall not be chosen."""
    joints: tuple[Joint, ...] = ()
    """One table a joint, where one says what drives it."""


class TipJoint(Joint):
    posture: Annotated[Number, Unit("rad or m")] = 0.0
    """From where inverse kinematics begins: it chooses the elbow, and a joint that is free to choose stays near it."""
    low: Annotated[Number | None, Unit("rad or m")] = None
    """Lower limit, which the motion must keep."""
    high: Annotated[Number | None, Unit("rad or m")] = None
    """Upper limit, which the motion must keep."""

    @model_validator(mode="after")
    def _is_a_range(self) -> "TipJoint":
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError("a `low` below `high`")
        return self


class TipPath(MotionTable):
    """The joints follow when the tip of the rigid arm is led along a periodic path, by inverse kinematics."""

    kind: Literal["tip-path"]
    """The kind of motion."""
    path: AnyPath
    """The path, in world axes."""
    follow: Annotated[tuple[Literal["x", "y", "z"], ...], Field(min_length=1, max_length=3)] = ("x", "y", "z")
    """The components of the position that are led; of an arm in its plane x and y."""
    joints: tuple[TipJoint, ...] = ()
    """One table a joint, where one has anything to say."""


AnyMotion = Annotated[
    Harmonic | Rotation | Fourier | PointToPoint | TableMotion | LogMotion | TipPath, Field(discriminator="kind")
]
