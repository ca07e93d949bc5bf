"""What the tables of a link and of a payload say of space: directions, where a joint is mounted, rigid bodies with full inertia."""

from typing import Annotated, Any

from pydantic import AfterValidator, model_validator

from flexlin.scene.base import NonNegative, Number, Table, Unit

Vector = tuple[Number, Number, Number]
ROUNDING = 1e-9
"""Relative to an inertia's largest entry: what is less negative than this is rounding."""


def _not_zero(value: Vector) -> Vector:
    if not any(value):
        raise ValueError("three numbers, not all of them zero")
    return value


Axis = Annotated[Vector, AfterValidator(_not_zero)]
"""Three numbers that need not have length 1."""


class Mount(Table):
    """Where a joint's frame lies in the frame of the tip before it: `xyz` in m, then turned by roll, pitch and yaw, as in URDF."""

    xyz: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    """Place of the joint's frame."""
    rpy: Annotated[Vector, Unit("rad")] = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of the joint's frame."""


class Inertia(Table):
    """The inertia of a body about its centre, in its frame's axes (kg m^2); products as in URDF, xy = -int x y dm."""

    xx: Annotated[NonNegative, Unit("kg m^2")] = 0.0
    """Entry xx of the inertia."""
    yy: Annotated[NonNegative, Unit("kg m^2")] = 0.0
    """Entry yy of the inertia."""
    zz: Annotated[NonNegative, Unit("kg m^2")] = 0.0
    """Entry zz of the inertia."""
    xy: Annotated[Number, Unit("kg m^2")] = 0.0
    """Entry xy of the inertia."""
    xz: Annotated[Number, Unit("kg m^2")] = 0.0
    """Entry xz of the inertia."""
    yz: Annotated[Number, Unit("kg m^2")] = 0.0
    """Entry yz of the inertia."""

    @model_validator(mode="after")
    def _is_an_inertia(self) -> "Inertia":
        if not any(self.entries().values()):
            return self
        import numpy as np  # a scene without bodies in space is read without it

        matrix = np.array([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])
        if np.linalg.eigvalsh(matrix).min() < -ROUNDING * np.abs(matrix).max():
            raise ValueError("principal inertias that are not negative")
        return self

    def entries(self) -> dict[str, Any]:
        """The six entries by name."""
        return {name: getattr(self, name) for name in type(self).model_fields}


class RigidPart(Table):
    """A rigid body in a link's frame: mass (kg), centre (m), inertia about the centre (kg m^2)."""

    mass: Annotated[NonNegative, Unit("kg")]
    """Mass of the body."""
    centre: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    """Its centre in the link's frame."""
    inertia: Inertia = Inertia()
    """Its inertia about its centre."""
