"""The links of a planar chain."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from flexlin.scene.base import NonNegative, Number, Positive, Table

MAX_MODES = 60


class Sections(Table):
    """Relative mass and stiffness of a tapered link at places xi = x/l from 0 to 1, linear between them."""

    at: Annotated[tuple[NonNegative, ...], Field(min_length=2)]
    mass: tuple[Positive, ...]
    stiffness: tuple[Positive, ...]

    @model_validator(mode="after")
    def _is_a_partition(self) -> "Sections":
        if self.at[0] != 0 or self.at[-1] != 1 or list(self.at) != sorted(set(self.at)):
            raise ValueError("a table whose `at` increases from 0 to 1")
        if not len(self.at) == len(self.mass) == len(self.stiffness):
            raise ValueError("as many numbers in `mass` and `stiffness` as in `at`")
        return self


class Carried(Table):
    """The rigid body for which loaded shapes are made: mass in kg, inertia about the link's tip in kg m^2."""

    mass: NonNegative
    inertia: NonNegative = 0.0


class Link(Table):
    """A slender link behind its joint: Euler-Bernoulli bending in the plane, `modes` assumed modes (0: rigid).

    `mount_angle` turns the joint against the tip before it; a prismatic joint moves the link along its own axis.
    A moving base is a carriage: a rigid link of no length and no mass on a prismatic joint with a prescribed motion.
    """

    length: NonNegative
    mass_per_length: NonNegative
    bending_stiffness: Positive | None = None
    modes: Annotated[int, Field(strict=True, ge=0, le=MAX_MODES)] = 0
    mode_shapes: Literal["clamped-free", "clamped-loaded", "pinned-free", "pinned-hub", "finite-element"] = (
        "clamped-free"
    )
    elements: Annotated[int, Field(strict=True, ge=1, le=500)] = 40
    carried: Carried | None = None
    sections: Sections | None = None
    joint: Literal["revolute", "prismatic"] = "revolute"
    mount_angle: Number = 0.0

    @property
    def pinned(self) -> bool:
        """Whether the shapes turn at the base, so that the hub turns by more than the joint's coordinate."""
        return self.mode_shapes.startswith("pinned")
