"""What one table of a scene demands of another; checked on the raw data, so that all errors come at once."""

import re
from collections.abc import Iterator
from typing import Any

from flexlin.errors import Problem
from flexlin.scene.base import MOST
from flexlin.scene.control_rules import control_contradictions
from flexlin.scene.effects import RawArm, effect_contradictions, known_effects, tables_on
from flexlin.scene.link_rules import driven, link_contradictions, mode_counts, moves
from flexlin.scene.loop_rules import loop_contradictions
from flexlin.scene.weights import Weights
from flexlin.text import hint_at, printable

COORDINATE = re.compile(r"(q|w|theta|phi|beta)\w*\d(_rate)?")
"""What names of coordinates of a chain, and of their rates, look like."""


def contradictions(raw: dict[str, Any]) -> list[Problem]:
    """List where the tables of a raw scene do not fit each other; lists too long to be looked at are the schema's to refuse."""
    if any(isinstance(raw.get(key), list) and len(raw[key]) > MOST for key in ("links", "loops", "designs")):
        return []
    return [*_links(raw), *_joint_counts(raw), *_design_names(raw), *_weighted(raw)]


def _links(raw: dict[str, Any]) -> Iterator[Problem]:
    links, model = _tables(raw.get("links")), raw.get("model")
    if model is None and not links:
        yield Problem("links", "none", "at least one [[links]] table, or model = the name of a registered model")
    if model is not None and links:
        yield Problem("links", f"{len(links)} tables beside model = {model!r}", "either links or a model")
    if model is not None and raw.get("effects"):
        yield Problem(
            "effects", f"tables beside model = {model!r}", "no effects: a registered model has its own parameters"
        )
    if model is None and raw.get("parameters"):
        yield Problem(
            "parameters", "a table without model", "parameters only beside model = the name of a registered model"
        )
    last = max((i for i, link in enumerate(links) if moves(link)), default=0)
    if links and not any(_has_mass(link, raw) for link in links[last:]):
        yield Problem(
            f"links.{len(links) - 1}.mass_per_length",
            "0",
            f"a positive number, or an effect that gives the last link inertia ({_bodies()})",
        )
    arm = RawArm(links, _motion_joints(raw, links))
    yield from link_contradictions(arm)
    yield from loop_contradictions(links, _tables(raw.get("loops")), model)
    yield from effect_contradictions(_effects(raw), arm)


def _effects(raw: dict[str, Any]) -> dict[str, Any]:
    return raw["effects"] if isinstance(raw.get("effects"), dict) else {}


def _bodies() -> str:
    """The effects that can give a link inertia."""
    return " or ".join(name for name, effect in known_effects().items() if effect.inertia_keys)


def _motion_joints(raw: dict[str, Any], links: list[dict[str, Any]]) -> list[Any]:
    """The raw table of the motion of each link's joint, with the motion's default drive; empty for a fixed joint."""
    motion = raw["motion"] if isinstance(raw.get("motion"), dict) else {}
    tables = iter([{"drive": motion.get("drive", "torque"), **joint} for joint in _tables(motion.get("joints"))])
    return [next(tables, {}) if driven(link) else {} for link in links]


def _has_mass(link: dict[str, Any], raw: dict[str, Any]) -> bool:
    """Whether a link at the end, with what it carries, has inertia; unknown counts as yes."""
    effects = _effects(raw)
    own = link.get("mass_per_length", 0 if "body" in link else None) != 0
    body = link["body"].get("mass") != 0 if isinstance(link.get("body"), dict) else False
    return own or body or any(effect.gives_inertia(effects[name]) for name, effect in tables_on(effects))


def _joint_counts(raw: dict[str, Any]) -> Iterator[Problem]:
    links = _tables(raw.get("links"))
    motion = raw["motion"] if isinstance(raw.get("motion"), dict) else {}
    joints = motion.get("joints")
    if not links or not isinstance(joints, list):
        return
    moving = sum(driven(link) for link in links)
    if len(joints) not in ({0, moving} if motion.get("kind") in ("table", "tip-path") else {moving}):
        yield Problem(
            "motion.joints", f"{len(joints)} tables", f"{moving}, one for each link's joint{_but_passive(links)}"
        )
        return
    default = motion.get("drive", "torque")
    powered = sum(joint.get("drive", default) == "torque" for joint in _tables(joints))
    control = raw["control"] if isinstance(raw.get("control"), dict) else {}
    yield from control_contradictions(control, powered)
    coordinates = powered + _added_coordinates(links, raw)
    for i, design in enumerate(_tables(raw.get("designs"))):
        for key, wanted, what in (
            ("state_weight", 2 * coordinates, "state"),
            ("input_weight", powered, "torque-driven joint"),
        ):
            weights = design.get(key)
            if isinstance(weights, list) and len(weights) != wanted:
                yield Problem(f"designs.{i}.{key}", f"{len(weights)} numbers", f"{wanted}, one for each {what}")


def _but_passive(links: list[dict[str, Any]]) -> str:
    """Which joints need no motion, where there are any."""
    return " that is not passive" if any(link.get("passive") is True for link in links) else ""


def _added_coordinates(links: list[dict[str, Any]], raw: dict[str, Any]) -> int:
    """How many coordinates there are beside the driven joints: modes, free motors, two of each bearing that gives."""
    modes = [count for link in links for count in mode_counts(link).values()]
    own, moving = ([i for i, link in enumerate(links) if rule(link)] for rule in (driven, moves))
    tables = [(effect, _effects(raw)[name]) for name, effect in tables_on(_effects(raw))]
    motors = max((effect.count_motors(table, own) for effect, table in tables), default=0)
    bearings = max((effect.count_bearings(table, moving) for effect, table in tables), default=0)
    return sum(modes) + motors + 2 * bearings


def _design_names(raw: dict[str, Any]) -> Iterator[Problem]:
    names = [design.get("name") for design in _tables(raw.get("designs"))]
    for i, name in enumerate(names):
        if name in names[:i]:
            yield Problem(f"designs.{i}.name", f"{name!r} a second time", "a name of its own")


def _weighted(raw: dict[str, Any]) -> Iterator[Problem]:
    """Keys of weights that are neither a group nor like a coordinate of a chain; a registered model may name its own."""
    groups = list(Weights.model_fields)
    for i, design in enumerate(_tables(raw.get("designs"))):
        weights = design.get("weights") if raw.get("model") is None else None
        for key in weights if isinstance(weights, dict) else ():
            if key not in groups and not COORDINATE.fullmatch(str(key)):
                hint = hint_at(str(key), groups)
                expected = f"one of {', '.join(groups)}, or a coordinate such as q1, w11, w11_rate{hint}"
                yield Problem(f"designs.{i}.weights.{printable(key)}", "an unknown key", expected)


def _tables(value: object) -> list[dict[str, Any]]:
    """The tables in a raw list; anything else is the schema's to complain about."""
    return [table for table in value if isinstance(table, dict)] if isinstance(value, list) else []
