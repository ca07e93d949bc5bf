"""The links of a chain with their sections and directions in space, and the loops that close it."""

import tomllib
from collections.abc import Sequence
from math import pi, tanh
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, TypeAdapter, WrapValidator, model_validator

from flexlin.bounds import MOST_ITEMS, SMALLEST_NUMBER, printable
from flexlin.errors import Problem
from flexlin.scene.base import NonNegative, Number, Positive, Table, Text, Unit
from flexlin.scene.problems import read_table

Material = Literal["aluminium", "steel", "stainless steel", "titanium", "brass"]
MATERIALS: dict[str, dict[str, float]] = tomllib.loads(
    Path(__file__).with_name("materials.toml").read_text(encoding="utf-8")
)
"""Figures of the materials by name, in SI units; the file says where they come from."""
SHAPES = ({"width", "thickness"}, {"diameter"}, {"diameter", "wall"})
FOLLOW = ("mass_per_length", "bending_stiffness", "torsional_stiffness", "polar_inertia")
"""The keys of a link that a section stands for."""
ASKED = {"shear": "stiffness", "rotary_inertia": "radius_of_gyration"}
"""Effects with a key that follows from the sections where every link has one."""


class CrossSection(Table):
    """A strip (width, thickness), a rod (diameter) or a tube (diameter, wall); what is written out goes before the material's."""

    width: Annotated[Positive | None, Unit("m")] = None
    """Of a strip, along the link's z."""
    thickness: Annotated[Positive | None, Unit("m")] = None
    """Of a strip, along the link's y, in which a planar arm bends."""
    diameter: Annotated[Positive | None, Unit("m")] = None
    """Of a rod or a tube, outside."""
    wall: Annotated[Positive | None, Unit("m")] = None
    """Thickness of a tube's wall."""
    material: Material | None = None
    """Name of a material."""
    density: Annotated[Positive | None, Unit("kg/m^3")] = None
    """Density of the material."""
    youngs_modulus: Annotated[Positive | None, Unit("Pa")] = None
    """Young's modulus of the material."""
    poisson_ratio: Annotated[float | None, Field(strict=True, ge=0, lt=0.5), Unit("")] = None
    """Poisson's ratio of the material; 0.3 where none is known."""

    @model_validator(mode="after")
    def _is_whole(self) -> "CrossSection":
        if {key for shape in SHAPES for key in shape if getattr(self, key) is not None} not in SHAPES:
            raise ValueError("width and thickness of a strip, diameter of a rod, or diameter and wall of a tube")
        if self.wall is not None and self.diameter is not None and 2 * self.wall >= self.diameter:
            raise ValueError("a wall thinner than half of the diameter, or none for a rod")
        if self.material is None and (self.density is None or self.youngs_modulus is None):
            raise ValueError(f"material, one of {', '.join(MATERIALS)}, or density and youngs_modulus")
        return self

    def figures(self) -> dict[str, Any]:
        """What follows for a link, by its keys, and for effects, by their names."""
        own = {key: value for key in MATERIALS["steel"] if (value := getattr(self, key)) is not None}
        material = {"poisson_ratio": 0.3} | MATERIALS.get(self.material or "", {}) | own
        density, E, nu = (material[key] for key in ("density", "youngs_modulus", "poisson_ratio"))
        G = E / (2 * (1 + nu))
        if self.width is not None and self.thickness is not None:
            area, about_y, about_z, J, kappa = strip(self.width, self.thickness, nu)
        else:
            outer = (self.diameter or 0.0) / 2
            area, about_y, about_z, J, kappa = tube(outer, 0.0 if self.wall is None else outer - self.wall, nu)
        return {
            "mass_per_length": density * area,
            "bending_stiffness": [E * about_y, E * about_z],
            "torsional_stiffness": G * J,
            "polar_inertia": density * (about_y + about_z),
            "shear": kappa * G * area,
            "rotary_inertia": (about_z / area) ** 0.5,
        }


Geometry = tuple[float, float, float, float, float]
"""Area, second moments about y and about z, torsion constant, shear coefficient."""


def strip(width: float, thickness: float, nu: float) -> Geometry:
    """A rectangle: J = a b^3/3 (1 - 192 b/(pi^5 a) sum_odd tanh(n pi a/(2 b))/n^5), a > b."""
    a, b = max(width, thickness), min(width, thickness)
    series = sum(tanh(n * pi * a / (2 * b)) / n**5 for n in range(1, 40, 2))
    J = a * b**3 / 3 * (1 - 192 * b / (pi**5 * a) * series)
    kappa = 10 * (1 + nu) / (12 + 11 * nu)
    return width * thickness, thickness * width**3 / 12, width * thickness**3 / 12, J, kappa


def tube(outer: float, inner: float, nu: float) -> Geometry:
    """A circle of the radius `outer` with a hole of the radius `inner`."""
    second, m = pi * (outer**4 - inner**4) / 4, (inner / outer) ** 2
    kappa = 6 * (1 + nu) * (1 + m) ** 2 / ((7 + 6 * nu) * (1 + m) ** 2 + (20 + 12 * nu) * m)
    return pi * (outer**2 - inner**2), second, second, 2 * second, kappa


def expand_sections(data: dict[str, Any]) -> list[Problem]:
    """Put what follows from the links' sections in their place, in raw data; returns the problems."""
    problems = list[Problem]()
    links, known = data["links"] if isinstance(data.get("links"), list) else [], []
    for i, link in enumerate(links):
        if isinstance(link, dict) and "section" in link:
            figures = _figures(f"links.{i}", link, problems)
            links[i] = {key: value for key, value in link.items() if key != "section"} | {
                key: figures[key] for key in FOLLOW
            }
            known.append(figures)
    effects = data["effects"] if isinstance(data.get("effects"), dict) else {}
    for name, key in ASKED.items():
        table = effects.get(name)
        if isinstance(table, dict) and known and len(known) == len(links):
            table.setdefault(key, [figures[name] for figures in known])
    return problems


def _figures(key: str, link: dict[str, Any], problems: list[Problem]) -> dict[str, Any]:
    """The figures of a link's section; those of some strip where it is at fault, so that no more is found wrong."""
    section = read_table(CrossSection, link["section"], f"{key}.section", problems)
    if section is None:
        return CrossSection(width=0.03, thickness=0.002, material="aluminium").figures()
    for name in FOLLOW:
        if name in link:
            got = f"{printable(repr(link[name]))[:60]} beside section"
            problems.append(Problem(f"{key}.{name}", got, "no value, since it follows from the section"))
    return section.figures()


Vector = tuple[Number, Number, Number]
INERTIA_ROUNDING = 1e-9
"""Relative to an inertia's largest entry: what is less negative than this is rounding."""


def _not_zero(value: Vector) -> Vector:
    if max(map(abs, value)) < SMALLEST_NUMBER:
        raise ValueError(f"three numbers, not all of them zero or smaller than {SMALLEST_NUMBER:g}")
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
        if any(self.entries().values()):
            import numpy as np  # a scene without bodies in space is read without it

            matrix = np.array(self.rows())
            if np.linalg.eigvalsh(matrix).min() < -INERTIA_ROUNDING * np.abs(matrix).max():
                raise ValueError("principal inertias that are not negative")
        return self

    def rows(self) -> list[list[Any]]:
        """The inertia as a matrix (3, 3)."""
        return [[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]]

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


Direction = Literal["y", "z", "torsion"]
DIRECTIONS: tuple[Direction, ...] = ("y", "z", "torsion")
"""How a link deflects: bent along its y, bent along its z, twisted about its x."""
Count = Annotated[int, Field(strict=True, ge=0, le=60)]


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

    link: Annotated[int, Field(strict=True, ge=0, le=MOST_ITEMS)]
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
    section: CrossSection | None = None
    """Its section, in the place of mass_per_length and the stiffnesses, which are made of it when the scene is read."""
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
