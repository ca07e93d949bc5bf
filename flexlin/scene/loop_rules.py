"""What the tables of loops, passive joints and parents demand of each other."""

from collections.abc import Iterator, Sequence
from typing import Any

from flexlin.errors import Problem
from flexlin.scene.effects import RawTable
from flexlin.scene.link_rules import moves, pinned
from flexlin.scene.loops import BASE


def loop_contradictions(links: Sequence[RawTable], loops: Sequence[RawTable], model: Any) -> Iterator[Problem]:
    """List what does not fit in raw tables of links and loops."""
    if model is not None and loops:
        yield Problem("loops", f"{len(loops)} tables beside model = {model!r}", "loops only beside [[links]]")
        return
    names = [link.get("name") for link in links]
    for i, link in enumerate(links):
        yield from _parent(f"links.{i}.parent", link, names, i)
        yield from _passive(f"links.{i}", link, bool(loops))
    if loops and not any(link.get("passive") is True for link in links):
        yield Problem("loops", f"{len(loops)} tables", "links with passive = true, whose joints the loops move")
    for i, loop in enumerate(loops):
        for key in ("link", "to"):
            allowed = [*names, BASE] if key == "to" else names
            yield from _named(f"loops.{i}.{key}", loop.get(key), allowed)
        if isinstance(loop.get("link"), str) and loop["link"] == loop.get("to"):
            yield Problem(f"loops.{i}.to", repr(loop["to"]), "another link than the one that is held")


def _parent(key: str, link: RawTable, names: list[Any], place: int) -> Iterator[Problem]:
    parent = link.get("parent")
    if isinstance(parent, str) and parent in names[place:] and parent not in names[:place]:
        yield Problem(key, repr(parent), "the name of a link before this one, or base")
    elif parent is not None:
        yield from _named(key, parent, [*names, BASE])


def _named(key: str, name: Any, names: list[Any]) -> Iterator[Problem]:
    """A name must be that of one link and no more."""
    if not isinstance(name, str):
        return
    if not name or name not in names:
        known = ", ".join(dict.fromkeys(str(known) for known in names if known))
        yield Problem(key, repr(name), f"the name of a link, one of {known}")
    elif names.count(name) > 1:
        yield Problem(key, repr(name), "a name that only one link bears")


def _passive(key: str, link: RawTable, loops: bool) -> Iterator[Problem]:
    if link.get("passive") is not True:
        return
    if not loops:
        yield Problem(f"{key}.passive", "true", "a [[loops]] table, from which the joint's displacement follows")
    if not moves(link):
        yield Problem(f"{key}.passive", "true beside a joint that is fixed or follows another", "a joint that moves")
    if pinned(link):
        yield Problem(f"{key}.mode_shapes", repr(link["mode_shapes"]), "clamped shapes, because the joint is passive")
