"""What a link's table demands of itself and of its joint's motion."""

from collections.abc import Iterator, Sequence

from flexlin.errors import Problem
from flexlin.scene.effects import RawArm, RawTable
from flexlin.text import printable

MOST_NAMED = 4
"""Keys that a message names."""


def link_contradictions(arm: RawArm) -> Iterator[Problem]:
    """List what does not fit in the raw tables of the links and of their joints' motion."""
    beams = [f"links.{i}.modes" for i, link in enumerate(arm.links) if link.get("bending_stiffness") is not None]
    for i, link in enumerate(arm.links):
        yield from _bending(f"links.{i}", link, beams)
        yield from _shapes(f"links.{i}", link)
        yield from _joint(f"links.{i}", link)
        yield from _mimic(f"links.{i}", link, arm.links[:i])
        if pinned(link) and i < len(arm.joints) and arm.joints[i].get("drive") == "prescribed":
            yield Problem(f"motion.joints.{i}.drive", "'prescribed'", "'torque', because the link's shapes are pinned")


def moves(link: RawTable) -> bool:
    """Whether a raw link's joint is a coordinate."""
    return link.get("joint", "revolute") != "fixed" and link.get("mimic") is None


def driven(link: RawTable) -> bool:
    """Whether the basic motion has a table for a raw link's joint."""
    return moves(link) and link.get("passive") is not True


def pinned(link: RawTable) -> bool:
    """Whether a raw link turns its hub by its shapes, so that the joint's coordinate is not the hub's angle."""
    return sum(mode_counts(link).values()) != 0 and str(link.get("mode_shapes", "")).startswith("pinned")


def mode_counts(link: RawTable) -> dict[str, int]:
    """The numbers of modes of a raw link by direction; what is no number counts as none."""
    modes = link.get("modes", 0)
    counts = modes if isinstance(modes, dict) else {"y": modes}
    return {key: count for key, count in counts.items() if isinstance(count, int)}


def _bending(key: str, link: RawTable, beams: Sequence[str]) -> Iterator[Problem]:
    """What a link with modes needs; `beams`: keys of the modes of links that can bend."""
    counts, left_out = mode_counts(link), 0 if "body" in link else None
    length, mass = (link.get(name, left_out) for name in ("length", "mass_per_length"))
    if not any(counts.values()):
        if link.get("length") == 0 and link.get("mass_per_length") != 0:
            yield Problem(f"{key}.length", "0", "a positive number, because the link has mass")
        return
    if length == mass == 0:  # a carriage or a rigid body
        others = [beam for beam in beams if beam != f"{key}.modes"]
        more = (
            f"any number for {' or '.join(others[:MOST_NAMED])}"
            if others
            else "length and mass_per_length for the link"
        )
        got = f"{printable(repr(link['modes'])[:60])} on a link of no length and no mass per length"
        yield Problem(f"{key}.modes", got, f"0, since it cannot bend, or {more}")
        return
    for setting, unit in (("torsional_stiffness", "N m^2"), ("polar_inertia", "kg m")):
        if counts.get("torsion") and link.get(setting) is None:
            yield Problem(
                f"{key}.{setting}", "nothing", f"a positive number in {unit}, because the link has modes of torsion"
            )
    if link.get("bending_stiffness") is None and (counts.get("y") or counts.get("z")):
        yield Problem(f"{key}.bending_stiffness", "nothing", "a positive number in N m^2, because modes is not 0")
    if mass == 0:
        yield Problem(f"{key}.mass_per_length", "0", "a positive number, because a link without mass has no modes")
    if length == 0:
        yield Problem(f"{key}.length", "0", "a positive number, because modes is not 0")


def _shapes(key: str, link: RawTable) -> Iterator[Problem]:
    shapes = link.get("mode_shapes", "clamped-free")
    for setting, needed in (("carried", "clamped-loaded"), ("elements", "finite-element")):
        if setting in link and shapes != needed:
            yield Problem(f"{key}.{setting}", f"a value beside mode_shapes = {shapes!r}", f"only beside {needed!r}")


def _joint(key: str, link: RawTable) -> Iterator[Problem]:
    joint, axis = link.get("joint", "revolute"), link.get("axis")
    if joint == "fixed" and axis is not None:
        yield Problem(f"{key}.axis", "an axis beside joint = 'fixed'", "no axis, or a joint that moves")
    if pinned(link) and any(count for direction, count in mode_counts(link).items() if direction != "y"):
        yield Problem(
            f"{key}.mode_shapes", repr(link["mode_shapes"]), "clamped shapes, because the link deflects in space"
        )
    if pinned(link) and joint == "fixed":
        yield Problem(f"{key}.mode_shapes", repr(link["mode_shapes"]), "clamped shapes, because the joint is fixed")
    if pinned(link) and axis not in (None, [0, 0, 1], (0, 0, 1)):
        yield Problem(f"{key}.mode_shapes", repr(link["mode_shapes"]), "clamped shapes, or a joint that turns about z")


def _mimic(key: str, link: RawTable, before: Sequence[RawTable]) -> Iterator[Problem]:
    if not isinstance(link.get("mimic"), dict):
        return
    other = link["mimic"].get("link")
    if isinstance(other, int) and not (0 <= other < len(before) and moves(before[other])):
        yield Problem(
            f"{key}.mimic.link", str(other), "the number of a link before it, from 0, whose joint moves by itself"
        )
    if link.get("joint") == "fixed":
        yield Problem(f"{key}.mimic", "a rule beside joint = 'fixed'", "a joint that moves, or no rule")
    if pinned(link):
        yield Problem(
            f"{key}.mode_shapes", repr(link["mode_shapes"]), "clamped shapes, because the joint follows another"
        )
