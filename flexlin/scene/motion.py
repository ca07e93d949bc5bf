"""The tables of the basic motions: one table a joint in `joints`."""

from typing import Annotated, Literal

from pydantic import Field

from flexlin.scene.base import NonNegative, Number, Positive, Table, Text

Drive = Literal["torque", "prescribed"]


class Joint(Table):
    """A joint is driven by torque, or its angle is a prescribed function of time and no coordinate."""

    drive: Drive | None = None


class HarmonicJoint(Joint):
    mean: Number = 0.0
    amplitude: Number
    phase: Number = 0.0


class RotationJoint(Joint):
    start: Number = 0.0
    rate: Number


class FourierJoint(Joint):
    mean: Number = 0.0
    cos: tuple[Number, ...] = ()
    sin: tuple[Number, ...] = ()


class PointToPointJoint(Joint):
    waypoints: Annotated[tuple[Number, ...], Field(min_length=2)]


class MotionTable(Table):
    """What all motions share: `drive` is the default of the joints."""

    drive: Drive = "torque"


class Harmonic(MotionTable):
    """q = mean + amplitude sin(2 pi f t + phase)."""

    kind: Literal["harmonic"]
    frequency: Positive
    joints: Annotated[tuple[HarmonicJoint, ...], Field(min_length=1)]


class Rotation(MotionTable):
    """q = start + rate t."""

    kind: Literal["rotation"]
    joints: Annotated[tuple[RotationJoint, ...], Field(min_length=1)]


class Fourier(MotionTable):
    """q = mean + sum_k cos_k cos(2 pi k t/T) + sin_k sin(2 pi k t/T)."""

    kind: Literal["fourier"]
    period: Positive
    joints: Annotated[tuple[FourierJoint, ...], Field(min_length=1)]


class PointToPoint(MotionTable):
    """Rest at each waypoint, move between them along a smooth polynomial.

    `course = "there-and-back"` retraces the waypoints and is periodic; `"one-way"` is a finite horizon.
    """

    kind: Literal["point-to-point"]
    move_time: Positive
    dwell_time: NonNegative = 0.0
    profile: Literal["quintic", "septic"] = "quintic"
    course: Literal["there-and-back", "one-way"] = "there-and-back"
    joints: Annotated[tuple[PointToPointJoint, ...], Field(min_length=1)]


class TableMotion(MotionTable):
    """Samples t, q1, q2 ... over one period in a CSV file, joined by a periodic quintic spline."""

    kind: Literal["table"]
    file: Text
    joints: tuple[Joint, ...] = ()


AnyMotion = Annotated[Harmonic | Rotation | Fourier | PointToPoint | TableMotion, Field(discriminator="kind")]
