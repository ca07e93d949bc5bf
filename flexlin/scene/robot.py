"""The tables by which a scene names a robot's URDF file and adds what such files cannot say: springs, gears, links that bend."""

from typing import Annotated, Literal

from pydantic import model_validator

from flexlin.scene.base import NonNegative, Number, Positive, Table, Text, Unit
from flexlin.scene.links import AnyModes


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
    modes: AnyModes = 0
    """Number of assumed modes, or a table of those in y, in z and of torsion."""
    mode_shapes: Literal["clamped-free", "clamped-loaded", "finite-element"] = "clamped-free"
    """The assumed modes' shapes."""
