"""What the elements that are read may hold: a word that is misspelt, or that stands where none may, is refused with its line."""

from collections.abc import Iterable

from flexlin.scene.urdf.elements import LONGEST, Element
from flexlin.text import hint_at, printable

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
