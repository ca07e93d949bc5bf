"""XML as plain elements that know their lines, without document types and entities; misspelt names are found."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from flexlin.errors import Problem, SceneError
from flexlin.files import read_text
from flexlin.scene.base import LARGEST
from flexlin.text import hint_at, printable

LARGEST_FILE = 2**22
"""Bytes of a URDF file; meshes are files of their own, which are not read."""
MOST_ELEMENTS = 50_000
DEEPEST = 32
LONGEST = 60
"""Characters of a value that are repeated in a message."""


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
        return SceneError(self.source, [Problem(f"line {self.line}, <{printable(self.tag)[:LONGEST]}>", got, expected)])

    def all(self, tag: str) -> list["Element"]:
        """The children of one kind."""
        return [child for child in self.children if child.tag == tag]

    def one(self, tag: str) -> "Element | None":
        """The only child of one kind, if there is any. Raises: SceneError where there are several."""
        found = self.all(tag)
        if len(found) > 1:
            raise found[1].refuse(f"a second <{tag}>", "one at most")
        return found[0] if found else None

    def text(self, name: str, default: str | None = None) -> str:
        """An attribute that is a name."""
        value = self.attributes.get(name, default)
        if value is None or not value.strip():
            raise self.refuse(f"no {name}", f'{name}="..."')
        if "${" in value or "$(" in value:
            raise self.refuse(
                f"{name}={printable(repr(value))[:LONGEST]}", "a name; a xacro file must be expanded first"
            )
        return printable(value)[:200]

    def numbers(self, name: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """An attribute of finite numbers, separated by blanks."""
        if name not in self.attributes:
            if default is None:
                raise self.refuse(f"no {name}", f"{name} with {count} number{'s' if count > 1 else ''}")
            return default
        words = self.attributes[name].split()
        try:
            values = tuple(float(word) for word in words)
        except ValueError:
            values = ()
        if len(values) != count or not all(math.isfinite(v) and abs(v) <= LARGEST for v in values):
            got = f"{name}={printable(repr(self.attributes[name]))[:LONGEST]}"
            raise self.refuse(got, f"{count} finite number{'s' if count > 1 else ''}")
        return values

    def number(self, name: str, default: float | None = None) -> float:
        """An attribute of one finite number."""
        return self.numbers(name, 1, None if default is None else (default,))[0]


class Builder:
    """Collects elements as a parser reports them."""

    def __init__(self, source: str) -> None:
        self.source, self.stack, self.count = source, list[Element](), 0
        self.root: Element | None = None
        self.parser: Any = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        element = Element(self.source, tag, self.parser.parser.CurrentLineNumber, dict(attributes))
        self.count += 1
        if self.count > MOST_ELEMENTS or len(self.stack) >= DEEPEST:
            raise element.refuse("elements without end", f"{MOST_ELEMENTS} at most, {DEEPEST} in each other")
        if self.stack:
            self.stack[-1].children.append(element)
        else:
            self.root = element
        self.stack.append(element)

    def end(self, tag: str) -> None:
        self.stack.pop()

    def data(self, text: str) -> None:
        """Text between elements: the first words are kept for a message."""
        if self.stack and self.stack[-1].words is None and text.strip():
            self.stack[-1].words = self.parser.parser.CurrentLineNumber, text.strip()

    def close(self) -> Element | None:
        return self.root


def read_elements(path: Path) -> Element:
    """Read a file's outermost element.

    Raises: SceneError, naming the line, for what is no XML, declares a document type or an entity, or is too large.
    """
    source = printable(path)
    try:
        return parse_elements(read_text(path, LARGEST_FILE), source)
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(source, [Problem("file", printable(error), "a readable URDF file")]) from None


def parse_elements(text: str, source: str) -> Element:
    """Parse XML text; errors as in `read_elements`."""
    builder = Builder(source)
    parser = builder.parser = DefusedXMLParser(target=builder, forbid_dtd=True)
    try:
        parser.feed(text.encode("utf-8", errors="replace"))
        root = parser.close()
    except ParseError as error:
        raise SceneError(
            source, [Problem(f"line {error.position[0]}", printable(error)[:200], "well-formed XML")]
        ) from None
    except (DefusedXmlException, LookupError, ValueError) as error:
        line = parser.parser.CurrentLineNumber
        got = "a document type or an entity" if isinstance(error, DefusedXmlException) else printable(error)[:200]
        raise SceneError(source, [Problem(f"line {line}", got, "plain XML in UTF-8 without them")]) from None
    finally:
        builder.parser = None
    if root is None:
        raise SceneError(source, [Problem("file", "nothing", "a <robot>")])
    return root


CHILDREN = {
    "robot": ("link", "joint"),
    "link": ("inertial",),
    "joint": ("origin", "parent", "child", "axis", "dynamics", "limit", "mimic"),
    "inertial": ("origin", "mass", "inertia"),
}
"""The children that are read, of each element that is read."""
ATTRIBUTES = {
    "robot": ("name",),
    "link": ("name",),
    "joint": ("name", "type"),
    "inertial": (),
    "origin": ("xyz", "rpy"),
    "mass": ("value",),
    "inertia": ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "dynamics": ("damping", "friction"),
    "limit": ("lower", "upper", "effort", "velocity"),
    "mimic": ("joint", "multiplier", "offset"),
}
"""The attributes that are read."""
CLOSED = ("inertial", "origin", "mass", "inertia", "axis", "mimic", "child")
"""Elements that hold nothing else; other programs put words of their own into the rest."""
ALIKE = 0.8
"""How much a word is like one that is read, from 0 to 1, to be taken for a misspelt one."""


def check_spelling(element: Element) -> None:
    """Look through an element and those below it that are read. Raises: SceneError naming the line."""
    if element.words is not None:
        line, words = element.words
        raise element.refuse(
            f"the text {printable(repr(words))[:LONGEST]} on line {line}", "elements and comments only"
        )
    expected = CHILDREN.get(element.tag, ())
    for child in element.children:
        if "xacro" in child.tag:
            raise child.refuse("an element of xacro", "plain URDF; a xacro file must be expanded first")
        if child.tag in expected:
            check_spelling(child)
        else:
            check_word(child, f"<{printable(child.tag)[:LONGEST]}>", child.tag, expected, element.tag)
    for name in element.attributes:
        if name not in ATTRIBUTES[element.tag]:
            check_word(element, f"{printable(name)[:LONGEST]}=", name, ATTRIBUTES[element.tag], element.tag)


def check_word(element: Element, got: str, word: str, known: Iterable[str], inside: str) -> None:
    """Refuse a word that is not read where nothing else may stand, or that looks like one that is read."""
    hint = hint_at(word, known, ALIKE)
    if inside in CLOSED or hint:
        raise element.refuse(f"{got} in <{inside}>", f"{', '.join(known) or 'nothing'}{hint}")
