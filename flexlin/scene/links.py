"""The links of a chain, and the loops that close it."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, WrapValidator, model_validator

from flexlin.scene.base import MOST, NonNegative, Number, Positive, Table, Text, Unit
from flexlin.scene.space import Axis, Mount, RigidPart, Vector

MAX_MODES = 60
Direction = Literal["y", "z", "torsion"]
DIRECTIONS: tuple[Direction, ...] = ("y", "z", "torsion")
"""How a link deflects: bent along its y, bent along its z, twisted about its x."""
Count = Annotated[int, Field(strict=True, ge=0, le=MAX_MODES)]


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


COUNT: TypeAdapter[int] = TypeAdapter(Count)


class Modes(Table):
    """How many assumed modes a link has: bent in y, bent in z, twisted."""

    y: Count = 0
    """Number of modes of bending in y."""
    z: Count = 0
    """Number of modes of bending in z."""
    torsion: Count = 0
    """Number of modes of twist."""

    def by_direction(self) -> dict[Direction, int]:
        """The numbers by direction, in the order of the coordinates."""
        return {"y": self.y, "z": self.z, "torsion": self.torsion}


def _count_or_table(value: Any, _: Any) -> "int | Modes":
    if isinstance(value, Modes):
        return value
    return Modes.model_validate(value) if isinstance(value, dict) else COUNT.validate_python(value)


AnyModes = Annotated[Count | Modes, WrapValidator(_count_or_table)]
"""A number of modes, or a table of them."""


class Carried(Table):
    """The rigid body for which loaded shapes are made: mass in kg, inertia about the link's tip in kg m^2."""

    mass: Annotated[NonNegative, Unit("kg")]
    """Mass of the body."""
    inertia: Annotated[NonNegative, Unit("kg m^2")] = 0.0
    """Its inertia about the link's tip."""


class Mimic(Table):
    """A joint that follows another: its displacement is multiplier q + offset, with q that of the joint before `link`."""

    link: Annotated[int, Field(strict=True, ge=0, le=MOST)]
    """Number of the link, from 0, whose joint is followed."""
    multiplier: Annotated[Number, Unit("")] = 1.0
    """Displacement for one unit of the other joint's."""
    offset: Annotated[Number, Unit("rad")] = 0.0
    """Displacement where the other joint's is 0."""


class Link(Table):
    """A slender link along x behind its joint: Euler-Bernoulli bending and St. Venant's twist, `modes` assumed modes (0: rigid).

    A number of modes stands for bending in the plane of x and y. `bending_stiffness` is EI, or the pair about y and about z:
    bending in z has the first, bending in y the second.

    The joint's frame is that of the tip before it, moved and turned by `mount` and then turned by `mount_angle` about z. The joint
    turns about `axis` (z) or slides along it (x). `body` is a rigid body where the link begins.
    A moving base is a carriage: a rigid link of no length and no mass on a prismatic joint with a prescribed motion.
    """

    length: Annotated[NonNegative, Unit("m")]
    """Length from joint to tip."""
    mass_per_length: Annotated[NonNegative, Unit("kg/m")]
    """Mass per length."""
    bending_stiffness: Annotated[Positive | tuple[Positive, Positive] | None, Unit("N m^2")] = None
    """Bending stiffness E I, or the pair about y and about z; a link without it is rigid."""
    torsional_stiffness: Annotated[Positive | None, Unit("N m^2")] = None
    """Torsional stiffness G J."""
    polar_inertia: Annotated[Positive | None, Unit("kg m")] = None
    """Polar inertia of the sections per length, rho I_p."""
    modes: AnyModes = 0
    """Number of assumed modes, or a table of those in y, in z and of torsion; 0 is a rigid link."""
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
    axis: Axis | None = None
    """The joint's axis in the link's frame; z for a turning joint, x for a sliding one."""
    mount: Mount = Mount()
    """Where the joint lies at the tip before it."""
    mount_angle: Annotated[Number, Unit("rad")] = 0.0
    """Angle by which the joint's frame is turned about z."""
    body: RigidPart | None = None
    """A rigid body where the link begins."""
    mimic: Mimic | None = None
    """The rule by which the joint follows another, and is no coordinate."""
    name: Text = ""
    """Name of the joint, as in a URDF file."""
    parent: Text | None = None
    """Name of the link whose tip carries this one, or base for the ground; by default the link before."""
    passive: Annotated[bool, Field(strict=True)] = False
    """Whether the joint has no motor and follows from closed loops."""
    posture: Annotated[Number, Unit("rad or m")] = 0.0
    """Displacement near the middle of the motion, from which loops are closed first: it chooses the assembly."""

    @model_validator(mode="before")
    @classmethod
    def _may_be_rigid_alone(cls, raw: Any) -> Any:
        """A link whose table has a rigid body may leave out the beam."""
        return {"length": 0.0, "mass_per_length": 0.0, **raw} if isinstance(raw, dict) and "body" in raw else raw

    @property
    def counts(self) -> Modes:
        """The numbers of modes by direction."""
        return self.modes if isinstance(self.modes, Modes) else Modes.model_construct(y=self.modes, z=0, torsion=0)

    def stiffness_in(self, direction: Direction) -> Any:
        """GJ for twist, EI about z for bending in y, EI about y for bending in z."""
        if direction == "torsion":
            return self.torsional_stiffness
        both = self.bending_stiffness
        return both["zy".index(direction)] if isinstance(both, tuple) else both

    @property
    def moves(self) -> bool:
        """Whether the link's joint is a coordinate."""
        return self.joint != "fixed" and self.mimic is None

    @property
    def driven(self) -> bool:
        """Whether the basic motion has a table for the link's joint."""
        return self.moves and not self.passive

    @property
    def joint_axis(self) -> Axis:
        """The joint's axis in the link's frame: where none is given z for a turning joint, x for a sliding one."""
        return self.axis or ((1.0, 0.0, 0.0) if self.joint == "prismatic" else (0.0, 0.0, 1.0))

    @property
    def pinned(self) -> bool:
        """Whether the shapes turn at the base, so that the hub turns by more than the joint's coordinate."""
        return self.mode_shapes.startswith("pinned")


BASE = "base"
"""The name of the ground, on which the first link stands."""
NO_LINK = -1


class Loop(Table):
    """A ball joint that holds the tip of one link to another link, or to the ground, and so closes a loop; in a plane a hinge.

    The displacements of the links' `passive` joints follow from all loops together.
    """

    link: Text
    """Name of the link whose tip is held."""
    to: Text
    """Name of the link that holds it, or base for the ground."""
    point: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    """Where on it: seen from its tip in the tip's axes, on the ground from the origin."""


def list_parents(links: Sequence[Link]) -> list[int]:
    """For each link the number of the one whose tip carries it, -1 for the ground: the link before, unless `parent` names another."""
    names = [link.name for link in links]
    parents = []
    for i, link in enumerate(links):
        named = link.parent
        parents.append(i - 1 if named is None else NO_LINK if named == BASE else names.index(named))
    return parents
