"""What a URDF file says of a robot: links with their inertia, joints with axes, origins and limits."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar
from xml.parsers import expat

from flexlin import bounds
from flexlin.errors import Problem, SceneError


def shown(text: str) -> str:
    """A piece of a file as a message shows it."""
    return bounds.printable(text)[: bounds.LONGEST_SHOWN]


@dataclass
class Element:
    """An element of a file: its tag, line, attributes and children; the first words between these, with their line."""

    source: str
    tag: str
    line: int
    attributes: dict[str, str]
    children: list["Element"] = field(default_factory=list)
    words: tuple[int, str] | None = None

    def refuse(self, got: str, expected: str) -> SceneError:
        """The error that this element is the cause of."""
        return SceneError(self.source, [Problem(f"line {self.line}, <{shown(self.tag)}>", got, expected)])

    def all(self, tag: str) -> list["Element"]:
        """The children of one kind."""
        return [child for child in self.children if child.tag == tag]

    def one(self, tag: str) -> "Element | None":
        """The only child of one kind, if there is any. Raises: SceneError where there are several."""
        found = self.all(tag)
        if len(found) > 1:
            raise found[1].refuse(f"a second <{tag}>", "one at most")
        return found[0] if found else None

    def text(self, name: str) -> str:
        """An attribute that is a name."""
        value = self.attributes.get(name)
        if value is None or not value.strip():
            raise self.refuse(f"no {name}", f'{name}="..."')
        if "${" in value or "$(" in value:
            raise self.refuse(f"{name}={shown(repr(value))}", "a name; a xacro file must be expanded first")
        return bounds.printable(value)[:200]

    def numbers(self, name: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """An attribute of finite numbers, separated by blanks."""
        if name not in self.attributes:
            if default is None:
                raise self.refuse(f"no {name}", f"{name} with {count} number{'s' if count > 1 else ''}")
            return default
        words = self.attributes[name].split()
        try:
            values = tuple(map(bounds.read_number, words))
        except ValueError:
            values = ()
        if len(values) != count:
            got = f"{name}={shown(repr(self.attributes[name]))}"
            raise self.refuse(got, f"{count} finite number{'s' if count > 1 else ''}")
        return values

    def number(self, name: str, default: float | None = None) -> float:
        """An attribute of one finite number."""
        return self.numbers(name, 1, None if default is None else (default,))[0]


def read_elements(path: Path) -> Element:
    """Read a file's outermost element.

    Raises: SceneError, naming the line, for what is no XML, declares a document type, and with it entities, or is too large.
    """
    source, parser, count = bounds.printable(path), expat.ParserCreate("utf-8"), 0
    whole = Element(source, "", 0, {})
    stack = [whole]

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        element, count = Element(source, tag, parser.CurrentLineNumber, attributes), count + 1
        if count > bounds.MOST_ELEMENTS or len(stack) > bounds.DEEPEST_NESTING:
            raise element.refuse(
                "elements without end", f"{bounds.MOST_ELEMENTS} at most, {bounds.DEEPEST_NESTING} in each other"
            )
        stack[-1].children.append(element)
        stack.append(element)

    def keep_words(text: str) -> None:
        if stack[-1].words is None and text.strip():
            stack[-1].words = parser.CurrentLineNumber, text.strip()

    def refuse_type(*_: object) -> None:
        line = f"line {parser.CurrentLineNumber}"
        raise SceneError(source, [Problem(line, "a document type or an entity", "plain XML without them")])

    parser.StartElementHandler, parser.EndElementHandler = start, lambda tag: stack.pop()
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = keep_words, refuse_type
    try:
        parser.Parse(bounds.read_text(path, bounds.LARGEST_ROBOT).encode("utf-8", errors="replace"), True)
    except OSError as error:
        got = bounds.printable(error.strerror or error)
        raise SceneError(source, [Problem("file", got, "a readable URDF file")]) from None
    except expat.ExpatError as error:
        raise SceneError(
            source, [Problem(f"line {error.lineno}", bounds.printable(error), "well-formed XML")]
        ) from None
    return whole.children[0]


READ = {
    "robot": ("name", "link joint"),
    "link": ("name", "inertial"),
    "joint": ("name type", "origin parent child axis dynamics limit mimic"),
    "inertial": ("", "origin mass inertia"),
    "origin": ("xyz rpy", ""),
    "mass": ("value", ""),
    "inertia": ("ixx iyy izz ixy ixz iyz", ""),
    "parent": ("link", ""),
    "child": ("link", ""),
    "axis": ("xyz", ""),
    "dynamics": ("damping friction", ""),
    "limit": ("lower upper effort velocity", ""),
    "mimic": ("joint multiplier offset", ""),
}
"""The attributes and the children that are read, of each element that is read."""
CLOSED = ("inertial", "origin", "mass", "inertia", "axis", "mimic", "child")
"""Elements that hold nothing else; other programs put words of their own into the rest."""
SPELLING_LIKENESS = 0.8
"""How much a word is like one that is read, from 0 to 1, to be taken for a misspelt one."""


def check_spelling(element: Element) -> None:
    """Look through an element and those below it that are read. Raises: SceneError naming the line."""
    if element.words is not None:
        line, words = element.words
        raise element.refuse(f"the text {shown(repr(words))} on line {line}", "elements and comments only")
    attributes, children = (words.split() for words in READ[element.tag])
    for child in element.children:
        if "xacro" in child.tag:
            raise child.refuse("an element of xacro", "plain URDF; a xacro file must be expanded first")
        if child.tag in children:
            check_spelling(child)
        else:
            check_word(child, f"<{shown(child.tag)}>", child.tag, children, element.tag)
    for name in element.attributes:
        if name not in attributes:
            check_word(element, f"{shown(name)}=", name, attributes, element.tag)


def check_word(element: Element, got: str, word: str, known: Iterable[str], inside: str) -> None:
    """Refuse a word that is not read where nothing else may stand, or that looks like one that is read."""
    hint = bounds.hint_at(word, known, SPELLING_LIKENESS)
    if inside in CLOSED or hint:
        raise element.refuse(f"{got} in <{inside}>", f"{', '.join(known) or 'nothing'}{hint}")


KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
MOST_LINKS = 2000
POINT_INERTIA = 1e-16
"""Inertia for a mass, in m^2, that is only rounding of centimetres squared: files hold such numbers for mass points."""
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
class Rule:
    """q = multiplier * q of the joint `leader` + offset."""

    leader: str
    multiplier: float = 1.0
    offset: float = 0.0

    def behind(self, other: "Rule") -> "Rule":
        """The rule of a joint whose leader follows `other`'s."""
        return Rule(other.leader, self.multiplier * other.multiplier, self.multiplier * other.offset + self.offset)


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
    mimic: Rule | None


Part = TypeVar("Part", UrdfLink, UrdfJoint)


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
    links, joints = by_name(map(read_link, root.all("link"))), by_name(map(read_joint, root.all("joint")))
    if len(links) > MOST_LINKS:
        raise root.refuse(f"{len(links)} links", f"{MOST_LINKS} at most")
    if not links:
        raise root.refuse("no <link>", "at least one")
    check_tree(links, joints)
    name = bounds.printable(root.attributes.get("name", ""))[:200]
    return Robot(name, root, links, joints, tuple(list_notes(root, links, joints)))


def by_name(parts: Iterable[Part]) -> dict[str, Part]:
    """Links or joints by their names, which no two share."""
    named = dict[str, Part]()
    for part in parts:
        if part.name in named:
            what = f"{part.element.tag} {part.name!r} a second time"
            raise part.element.refuse(what, "a name of its own")
        named[part.name] = part
    return named


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
    return UrdfLink(name, element, kilograms, xyz, rpy, entries)


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
    if axis is not None and kind != "fixed" and max(map(abs, direction)) < bounds.SMALLEST_NUMBER:
        expected = f"three numbers, not all of them zero or smaller than {bounds.SMALLEST_NUMBER:g}"
        raise axis.refuse("an axis of no length", expected)
    damping, friction = (dynamics.number(key, 0.0) if dynamics is not None else 0.0 for key in ("damping", "friction"))
    if dynamics is not None and min(damping, friction) < 0:
        raise dynamics.refuse(f"{min(damping, friction):g}", "damping and friction of 0 or more")
    xyz, rpy = read_origin(element.one("origin"))
    limits = {} if limit is None else read_limits(limit)
    follows = None
    if mimic is not None:
        follows = Rule(mimic.text("joint"), mimic.number("multiplier", 1.0), mimic.number("offset", 0.0))
    return UrdfJoint(name, element, kind, parent, child, xyz, rpy, direction, damping, friction, limits, follows)


def read_limits(limit: Element) -> dict[str, float]:
    """What a <limit> states."""
    keys = [key for key in ("lower", "upper", "velocity", "effort") if key in limit.attributes]
    limits: dict[str, float] = {key: limit.number(key) for key in keys}
    if limits.get("lower", 0.0) > limits.get("upper", 0.0):
        raise limit.refuse(f"lower {limits.get('lower', 0.0):g} above upper", "lower below upper")
    return limits


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
            got = f"link {joint.child!r} behind a second joint"
            raise joint.element.refuse(got, "a tree, each link behind one joint")
        behind[joint.child] = joint
        if joint.mimic is not None and (joint.mimic.leader not in joints or joint.mimic.leader == joint.name):
            raise joint.element.refuse(f"mimic of {joint.mimic.leader!r}", "another joint of the file")
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
    ignored = sorted({child.tag for child in root.children} - {"link", "joint"})
    shapes = sorted({part.tag for link in links.values() for part in link.element.children} - {"inertial"})
    bare = [link.name for link in links.values() if link.mass == 0]
    notes = [f"not read: {', '.join(f'<{tag[:40]}>' for tag in (*ignored, *shapes))}"] if ignored or shapes else []
    return notes + ([f"without mass: {', '.join(bare)}"] if bare else [])
