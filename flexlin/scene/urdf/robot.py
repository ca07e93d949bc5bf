"""What a URDF file says of a robot: links with their inertia, joints with axes, origins and limits."""

from dataclasses import dataclass
from pathlib import Path

from flexlin.scene.urdf.elements import Element, check_spelling, read_elements
from flexlin.text import printable

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
READ = {"link", "joint"}
MOST_LINKS = 2000
POINT = 1e-20
"""Inertia for a mass, in m^2, that is only rounding: files hold such numbers for mass points."""
Triple = tuple[float, ...]


@dataclass(frozen=True)
class UrdfLink:
    """A body: mass (kg), centre (m) and rpy (rad) of its inertial frame, inertia about the centre in that frame (kg m^2)."""

    name: str
    element: Element
    mass: float
    centre: Triple
    rpy: Triple
    inertia: dict[str, float]


@dataclass(frozen=True)
class UrdfMimic:
    """q = multiplier * q of another joint + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class UrdfJoint:
    """A joint between two links; `limits` holds lower, upper, velocity and effort as far as they are stated."""

    name: str
    element: Element
    kind: str
    parent: str
    child: str
    xyz: Triple
    rpy: Triple
    axis: Triple
    damping: float
    friction: float
    limits: dict[str, float]
    mimic: UrdfMimic | None


@dataclass(frozen=True)
class Robot:
    """Links and joints by name, and notes on what the file says beside them."""

    name: str
    element: Element
    links: dict[str, UrdfLink]
    joints: dict[str, UrdfJoint]
    notes: tuple[str, ...]


def read_robot(path: str | Path) -> Robot:
    """Read a URDF file; meshes and all that is not mechanics are left alone.

    Raises: SceneError, naming the line, for what contradicts itself or is no URDF.
    """
    root = read_elements(Path(path))
    if root.tag != "robot":
        raise root.refuse(f"<{root.tag[:60]}> outermost", "<robot>; a xacro file must be expanded first")
    check_spelling(root)
    links, joints = dict[str, UrdfLink](), dict[str, UrdfJoint]()
    for element in root.all("link"):
        link = read_link(element)
        if link.name in links:
            raise element.refuse(f"link {link.name!r} a second time", "a name of its own")
        links[link.name] = link
    for element in root.all("joint"):
        joint = read_joint(element)
        if joint.name in joints:
            raise element.refuse(f"joint {joint.name!r} a second time", "a name of its own")
        joints[joint.name] = joint
    if len(links) > MOST_LINKS:
        raise root.refuse(f"{len(links)} links", f"{MOST_LINKS} at most")
    if not links:
        raise root.refuse("no <link>", "at least one")
    check_tree(links, joints)
    return Robot(
        printable(root.attributes.get("name", ""))[:200], root, links, joints, tuple(list_notes(root, links, joints))
    )


def read_link(element: Element) -> UrdfLink:
    """One <link>; without <inertial> it has no mass."""
    name, inertial = element.text("name"), element.one("inertial")
    if inertial is None:
        return UrdfLink(name, element, 0.0, (0.0,) * 3, (0.0,) * 3, {})
    origin, mass, inertia = (inertial.one(tag) for tag in ("origin", "mass", "inertia"))
    xyz, rpy = read_origin(origin)
    if mass is None:
        raise inertial.refuse("no <mass>", "a <mass>")
    kilograms = mass.number("value")
    if kilograms < 0:
        raise mass.refuse(f"value {kilograms:g}", "0 kg or more")
    entries = {key: inertia.number(f"i{key}", 0.0) for key in ("xx", "yy", "zz", "xy", "xz", "yz")} if inertia else {}
    if inertia is not None and not is_inertia(entries, kilograms):
        raise inertia.refuse("a matrix with a negative principal inertia", "an inertia")
    return UrdfLink(name, element, kilograms, xyz, rpy, entries)


def is_inertia(entries: dict[str, float], mass: float) -> bool:
    """Whether the principal inertias are not negative, but for rounding."""
    import numpy as np

    xx, yy, zz, xy, xz, yz = (entries[key] for key in ("xx", "yy", "zz", "xy", "xz", "yz"))
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least = -1e-9 * np.abs(matrix).max() - POINT * mass
    return bool(np.linalg.eigvalsh(matrix).min() >= least and min(xx, yy, zz) >= -POINT * mass)


def read_origin(origin: Element | None) -> tuple[Triple, Triple]:
    """Place and angles of an <origin>."""
    zero = (0.0, 0.0, 0.0)
    return (zero, zero) if origin is None else (origin.numbers("xyz", 3, zero), origin.numbers("rpy", 3, zero))


def read_joint(element: Element) -> UrdfJoint:
    """One <joint>."""
    name, kind = element.text("name"), element.text("type")
    if kind not in KINDS:
        raise element.refuse(f"type {kind!r}", f"one of {', '.join(KINDS)}")
    parent, child = (read_end(element, tag) for tag in ("parent", "child"))
    axis, dynamics, limit, mimic = (element.one(tag) for tag in ("axis", "dynamics", "limit", "mimic"))
    direction = axis.numbers("xyz", 3) if axis is not None else (1.0, 0.0, 0.0)
    if axis is not None and kind != "fixed" and not any(direction):
        raise axis.refuse("an axis of no length", "three numbers, not all of them zero")
    damping, friction = (dynamics.number(key, 0.0) if dynamics is not None else 0.0 for key in ("damping", "friction"))
    if dynamics is not None and min(damping, friction) < 0:
        raise dynamics.refuse(f"{min(damping, friction):g}", "damping and friction of 0 or more")
    xyz, rpy = read_origin(element.one("origin"))
    limits = {} if limit is None else read_limits(limit)
    follows = None if mimic is None else read_mimic(mimic)
    return UrdfJoint(name, element, kind, parent, child, xyz, rpy, direction, damping, friction, limits, follows)


def read_limits(limit: Element) -> dict[str, float]:
    """What a <limit> states."""
    keys = [key for key in ("lower", "upper", "velocity", "effort") if key in limit.attributes]
    limits: dict[str, float] = {key: limit.number(key) for key in keys}
    if limits.get("lower", 0.0) > limits.get("upper", 0.0):
        raise limit.refuse(f"lower {limits.get('lower', 0.0):g} above upper", "lower below upper")
    return limits


def read_mimic(mimic: Element) -> UrdfMimic:
    """The rule of a <mimic>."""
    return UrdfMimic(mimic.text("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0))


def read_end(element: Element, tag: str) -> str:
    """The link at one end of a joint."""
    end = element.one(tag)
    if end is None:
        raise element.refuse(f"no <{tag}>", f'<{tag} link="..."/>')
    return end.text("link")


def check_tree(links: dict[str, UrdfLink], joints: dict[str, UrdfJoint]) -> None:
    """Every joint between links that are there, every link behind one joint, no circle, mimicked joints there."""
    behind: dict[str, UrdfJoint] = {}
    for joint in joints.values():
        for end in (joint.parent, joint.child):
            if end not in links:
                raise joint.element.refuse(f"link {end!r}", "the name of a link of the file")
        if joint.child in behind:
            raise joint.element.refuse(
                f"link {joint.child!r} behind a second joint", "a tree, each link behind one joint"
            )
        behind[joint.child] = joint
        if joint.mimic is not None and (joint.mimic.joint not in joints or joint.mimic.joint == joint.name):
            raise joint.element.refuse(f"mimic of {joint.mimic.joint!r}", "another joint of the file")
    for name in links:
        seen = {name}
        while name in behind:
            joint = behind[name]
            name = joint.parent
            if name in seen:
                raise joint.element.refuse("a circle of joints", "a tree")
            seen.add(name)


def list_notes(root: Element, links: dict[str, UrdfLink], joints: dict[str, UrdfJoint]) -> list[str]:
    """What the file holds that is not used, and what it leaves out."""
    ignored = sorted({child.tag for child in root.children} - READ)
    shapes = sorted({part.tag for link in links.values() for part in link.element.children} - {"inertial"})
    bare = [link.name for link in links.values() if link.mass == 0]
    notes = [f"not read: {', '.join(f'<{tag[:40]}>' for tag in (*ignored, *shapes))}"] if ignored or shapes else []
    return notes + ([f"without mass: {', '.join(bare)}"] if bare else [])
