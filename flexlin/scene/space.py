"""What the tables of a link and of a payload say of space: directions, where a joint is mounted, rigid bodies with full inertia."""

from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, model_validator

from flexlin.scene.base import NonNegative, Number, Table

Vector = tuple[Number, Number, Number]
ROUNDING = 1e-9
"""Relative to an inertia's largest entry: what is less negative than this is rounding."""


def _not_zero(value: Vector) -> Vector:
    if not any(value):
        raise ValueError("three numbers, not all of them zero")
    return value


Direction = Annotated[Vector, AfterValidator(_not_zero)]
"""Three numbers that need not have length 1."""


class Mount(Table):
    """Where a joint's frame lies in the frame of the tip before it: `xyz` in m, then turned by roll, pitch and yaw, as in URDF."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


class Inertia(Table):
    """The inertia of a body about its centre, in its frame's axes (kg m^2); products as in URDF, xy = -int x y dm."""

    xx: NonNegative = 0.0
    yy: NonNegative = 0.0
    zz: NonNegative = 0.0
    xy: Number = 0.0
    xz: Number = 0.0
    yz: Number = 0.0

    @model_validator(mode="after")
    def _is_an_inertia(self) -> "Inertia":
        matrix = np.array([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])
        if np.linalg.eigvalsh(matrix).min() < -ROUNDING * np.abs(matrix).max():
            raise ValueError("principal inertias that are not negative")
        return self

    def entries(self) -> dict[str, Any]:
        """The six entries by name."""
        return {name: getattr(self, name) for name in type(self).model_fields}


class RigidPart(Table):
    """A rigid body in a link's frame: mass (kg), centre (m), inertia about the centre (kg m^2)."""

    mass: NonNegative
    centre: Vector = (0.0, 0.0, 0.0)
    inertia: Inertia = Inertia()
