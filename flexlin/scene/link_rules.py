"""What a link's table demands of itself and of its joint's motion."""

from collections.abc import Iterator

from flexlin.errors import Problem
from flexlin.scene.effects import RawArm, RawTable


def link_contradictions(arm: RawArm) -> Iterator[Problem]:
    """List what does not fit in the raw tables of the links and of their joints' motion."""
    for i, link in enumerate(arm.links):
        yield from _bending(f"links.{i}", link)
        yield from _shapes(f"links.{i}", link)
        if pinned(link) and i < len(arm.joints) and arm.joints[i].get("drive") == "prescribed":
            yield Problem(f"motion.joints.{i}.drive", "'prescribed'", "'torque', because the link's shapes are pinned")


def pinned(link: RawTable) -> bool:
    """Whether a raw link turns its hub by its shapes, so that the joint's coordinate is not the hub's angle."""
    return link.get("modes", 0) != 0 and str(link.get("mode_shapes", "")).startswith("pinned")


def _bending(key: str, link: RawTable) -> Iterator[Problem]:
    if link.get("modes", 0) == 0:
        if link.get("length") == 0 and link.get("mass_per_length") != 0:
            yield Problem(f"{key}.length", "0", "a positive number, because the link has mass")
        return
    if link.get("bending_stiffness") is None:
        yield Problem(f"{key}.bending_stiffness", "nothing", "a positive number in N m^2, because modes is not 0")
    if link.get("mass_per_length") == 0:
        yield Problem(f"{key}.mass_per_length", "0", "a positive number, because a link without mass has no modes")
    if link.get("length") == 0:
        yield Problem(f"{key}.length", "0", "a positive number, because modes is not 0")


def _shapes(key: str, link: RawTable) -> Iterator[Problem]:
    shapes = link.get("mode_shapes", "clamped-free")
    for setting, needed in (("carried", "clamped-loaded"), ("elements", "finite-element")):
        if setting in link and shapes != needed:
            yield Problem(f"{key}.{setting}", f"a value beside mode_shapes = {shapes!r}", f"only beside {needed!r}")
