"""What the drives can give: peak and continuous limits, one a torque-driven joint or one for all."""

from typing import Annotated, Any

from pydantic import PlainValidator, WithJsonSchema

from flexlin.scene.base import Table, Unit
from flexlin.scene.units import ONE_OR_MORE, kept_quantities

AnyTorque = Annotated[Any, PlainValidator(kept_quantities("N m", "N")), WithJsonSchema(ONE_OR_MORE)]
AnySpeed = Annotated[Any, PlainValidator(kept_quantities("rad/s", "m/s")), WithJsonSchema(ONE_OR_MORE)]
AnyCurrent = Annotated[Any, PlainValidator(kept_quantities("A")), WithJsonSchema(ONE_OR_MORE)]
AnyPower = Annotated[Any, PlainValidator(kept_quantities("W")), WithJsonSchema(ONE_OR_MORE)]
AnyConstant = Annotated[Any, PlainValidator(kept_quantities("N m/A", "N/A")), WithJsonSchema(ONE_OR_MORE)]


class TorqueLimits(Table):
    """Limits of a joint's torque, or of its force where it slides."""

    peak: Annotated[AnyTorque | None, Unit("N m or N")] = None
    """Largest torque at any time, N m (N)."""
    continuous: Annotated[AnyTorque | None, Unit("N m or N")] = None
    """Largest root mean square of the torque over a period, N m (N)."""


class CurrentLimits(Table):
    """Limits of a motor's current."""

    peak: Annotated[AnyCurrent | None, Unit("A")] = None
    """Largest current at any time, A."""
    continuous: Annotated[AnyCurrent | None, Unit("A")] = None
    """Largest root mean square of the current over a period, A."""


class Drives(Table):
    """Limits at the joints, behind the gears: torque, speed, power, and the motors' current.

    Each limit is a quantity for all torque-driven joints, or a list of one each.
    """

    torque: TorqueLimits = TorqueLimits()
    """Limits of the torque."""
    speed: Annotated[AnySpeed | None, Unit("rad/s or m/s")] = None
    """Largest speed of the joint, rad/s (m/s)."""
    power: Annotated[AnyPower | None, Unit("W")] = None
    """Largest power at the joint, W."""
    current: CurrentLimits = CurrentLimits()
    """Limits of the motors' current."""
    torque_constant: Annotated[AnyConstant | None, Unit("N m/A or N/A")] = None
    """Torque at the joint for an ampere, N m/A (N/A); where [effects.motor] is on it is known already."""
