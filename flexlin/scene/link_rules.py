"""What a link's table demands of itself, of its joint's motion and of the effects' lists."""

from collections.abc import Iterator, Sequence
from typing import Any

from flexlin.errors import Problem

RawLink = dict[str, Any]
BODIES = ("hub", "payload")
EACH_LINK = (
    "rotary_inertia",
    "shear",
    "kelvin_voigt_damping",
    "joint_flexibility",
    "viscous_friction",
    "coulomb_friction",
    "motor",
)


def link_contradictions(links: Sequence[RawLink], effects: dict[str, Any], joints: Sequence[Any]) -> Iterator[Problem]:
    """List what does not fit in the raw tables of the links, of their effects and of their joints' motion."""
    for i, link in enumerate(links):
        yield from _bending(f"links.{i}", link)
        yield from _shapes(f"links.{i}", link, "shear" in effects)
        if _pinned(link):
            yield from _pinned_joint(i, effects, joints)
    for name, table in effects.items():
        for key, value in table.items() if isinstance(table, dict) else ():
            if isinstance(value, list):
                yield from _list_length(name, key, len(value), len(links))


def _list_length(effect: str, key: str, got: int, links: int) -> Iterator[Problem]:
    """A list has one number a link; for bodies the links beyond its end have none."""
    if effect in BODIES and got > links:
        yield Problem(f"effects.{effect}.{key}", f"{got} numbers", f"at most {links}, one for each link")
    if effect in EACH_LINK and got != links:
        yield Problem(f"effects.{effect}.{key}", f"{got} numbers", f"{links}, one for each link, or a single number")


def _bending(key: str, link: RawLink) -> Iterator[Problem]:
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


def _shapes(key: str, link: RawLink, sheared: bool) -> Iterator[Problem]:
    shapes = link.get("mode_shapes", "clamped-free")
    for setting, needed in (("carried", "clamped-loaded"), ("elements", "finite-element")):
        if setting in link and shapes != needed:
            yield Problem(f"{key}.{setting}", f"a value beside mode_shapes = {shapes!r}", f"only beside {needed!r}")
    if shapes == "finite-element" and sheared:
        yield Problem(
            f"{key}.mode_shapes", repr(shapes), "other shapes beside effects.shear, because these elements do not shear"
        )


def _pinned(link: RawLink) -> bool:
    return link.get("modes", 0) != 0 and str(link.get("mode_shapes", "")).startswith("pinned")


def _pinned_joint(i: int, effects: dict[str, Any], joints: Sequence[Any]) -> Iterator[Problem]:
    """A pinned shape turns the hub, so the joint's coordinate is not the hub's angle."""
    motion = joints[i] if i < len(joints) and isinstance(joints[i], dict) else {}
    if motion.get("drive") == "prescribed":
        yield Problem(f"motion.joints.{i}.drive", "'prescribed'", "'torque', because the link's shapes are pinned")
    hub = effects.get("hub")
    radius = hub.get("radius", 0) if isinstance(hub, dict) else 0
    own = (radius[i] if i < len(radius) else 0) if isinstance(radius, list) else (radius if i == 0 else 0)
    if own:
        yield Problem("effects.hub.radius", f"{own} on joint {i + 1}", "0 on a joint whose link has pinned shapes")
