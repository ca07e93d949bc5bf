"""The joints that close loops, and the tree of links in which they do: who carries whom."""

from collections.abc import Sequence
from typing import Annotated

from flexlin.scene.base import Table, Text, Unit
from flexlin.scene.links import Link
from flexlin.scene.space import Vector

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
