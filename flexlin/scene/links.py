"""The links of a chain."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from flexlin.scene.base import NonNegative, Number, Positive, Table, Unit
from flexlin.scene.space import Direction, Mount, RigidPart

MAX_MODES = 60


class Sections(Table):
    """Relative mass and stiffness of a tapered link at places xi = x/l from 0 to 1, linear between them."""

    at: Annotated[tuple[NonNegative, ...], Field(min_length=2)]
    """Places x/l from 0 to 1."""
    mass: tuple[Positive, ...]
    """Mass per length there, relative to mass_per_length."""
    stiffness: tuple[Positive, ...]
    """Bending stiffness there, relative to bending_stiffness."""

    @model_validator(mode="after")
    def _is_a_partition(self) -> "Sections":
        if self.at[0] != 0 or self.at[-1] != 1 or list(self.at) != sorted(set(self.at)):
            raise ValueError("a table whose `at` increases from 0 to 1")
        if not len(self.at) == len(self.mass) == len(self.stiffness):
            raise ValueError("as many numbers in `mass` and `stiffness` as in `at`")
        return self


class Carried(Table):
    """The rigid body for which loaded shapes are made: mass in kg, inertia about the link's tip in kg m^2."""

    mass: Annotated[NonNegative, Unit("kg")]
    """Mass of the body."""
    inertia: Annotated[NonNegative, Unit("kg m^2")] = 0.0
    """Its inertia about the link's tip."""


class Link(Table):
    """A slender link along x behind its joint: Euler-Bernoulli bending in the plane, `modes` assumed modes (0: rigid).

    The joint's frame is that of the tip before it, moved and turned by `mount` and then turned by `mount_angle` about z. The joint
    turns about `axis` (z) or slides along it (x). `body` is a rigid body where the link begins.
    A moving base is a carriage: a rigid link of no length and no mass on a prismatic joint with a prescribed motion.
    """

    length: Annotated[NonNegative, Unit("m")]
    """Length from joint to tip."""
    mass_per_length: Annotated[NonNegative, Unit("kg/m")]
    """Mass per length."""
    bending_stiffness: Annotated[Positive | None, Unit("N m^2")] = None
    """Bending stiffness E I; a link without it is rigid."""
    modes: Annotated[int, Field(strict=True, ge=0, le=MAX_MODES)] = 0
    """Number of assumed modes; 0 is a rigid link."""
    mode_shapes: Literal["clamped-free", "clamped-loaded", "pinned-free", "pinned-hub", "finite-element"] = (
        "clamped-free"
    )
    """The assumed modes' shapes."""
    elements: Annotated[int, Field(strict=True, ge=1, le=500)] = 40
    """Finite elements of which finite-element shapes are made."""
    carried: Carried | None = None
    """The body at the tip for which clamped-loaded shapes are made."""
    sections: Sections | None = None
    """How mass and stiffness vary along the link."""
    joint: Literal["revolute", "prismatic", "fixed"] = "revolute"
    """How the link moves against the one before it."""
    axis: Direction | None = None
    """The joint's axis in the link's frame; z for a turning joint, x for a sliding one."""
    mount: Mount = Mount()
    """Where the joint lies at the tip before it."""
    mount_angle: Annotated[Number, Unit("rad")] = 0.0
    """Angle by which the joint's frame is turned about z."""
    body: RigidPart | None = None
    """A rigid body where the link begins."""

    @model_validator(mode="before")
    @classmethod
    def _may_be_rigid_alone(cls, raw: Any) -> Any:
        """A link whose table has a rigid body may leave out the beam."""
        return {"length": 0.0, "mass_per_length": 0.0, **raw} if isinstance(raw, dict) and "body" in raw else raw

    @property
    def moves(self) -> bool:
        """Whether the link's joint lets it move."""
        return self.joint != "fixed"

    @property
    def joint_axis(self) -> Direction:
        """The joint's axis in the link's frame: where none is given z for a turning joint, x for a sliding one."""
        return self.axis or ((1.0, 0.0, 0.0) if self.joint == "prismatic" else (0.0, 0.0, 1.0))

    @property
    def pinned(self) -> bool:
        """Whether the shapes turn at the base, so that the hub turns by more than the joint's coordinate."""
        return self.mode_shapes.startswith("pinned")
