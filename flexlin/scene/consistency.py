"""What one table of a scene demands of another (links, control, loops); checked on the raw data, so that all errors come at once."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from flexlin.bounds import MOST_ITEMS, MOST_NAMED, hint_at, printable
from flexlin.errors import Problem, counted
from flexlin.scene.control import Weights
from flexlin.scene.effects import RawArm, RawTable, count_soft, effect_contradictions, known_effects, tables_on
from flexlin.scene.links import BASE


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
        named = f"any number for {' or '.join(others[:MOST_NAMED])}"
        more = named if others else "length and mass_per_length for the link"
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
    if not pinned(link):
        return
    reasons = {
        ", because the link deflects in space": any(n for way, n in mode_counts(link).items() if way != "y"),
        ", because the joint is fixed": joint == "fixed",
        ", because the joint follows another": isinstance(link.get("mimic"), dict),
        ", because the joint is passive": link.get("passive") is True,
        ", or a joint that turns about z": axis not in (None, [0, 0, 1], (0, 0, 1)),
    }
    for reason in (words for words, holds in reasons.items() if holds):
        yield Problem(f"{key}.mode_shapes", repr(link["mode_shapes"]), f"clamped shapes{reason}")


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


COUNTED = {"feedback": ("kp", "kd", "ki"), "saturation": ("torque", "rate"), "sampling": ("encoders", "torque")}
"""Keys that hold one number for each torque-driven joint."""


def control_contradictions(control: dict[str, Any], powered: int) -> Iterator[Problem]:
    """List what does not fit in the raw table of control of an arm with so many torque-driven joints."""
    tables = {key: value if isinstance(value, dict) else {} for key, value in control.items()}
    for table, key in ((table, key) for table, keys in COUNTED.items() for key in keys):
        yield from _one_each(f"control.{table}.{key}", tables.get(table, {}).get(key), powered, "torque-driven joint")
    feedback, filters = tables.get("feedback", {}), control.get("filters")
    if feedback.get("tracking_time") is not None and not tables.get("saturation"):
        yield Problem(
            "control.feedback.tracking_time", "a time without a limit", "[control.saturation], at which it acts"
        )
    if isinstance(filters, list) and filters and feedback.get("kind", "none") == "none":
        yield Problem("control.filters", "filters without a feedback", "[control.feedback], which they filter")
    if tables.get("saturation", {}).get("rate") is not None and tables.get("sampling"):
        yield Problem(
            "control.saturation.rate",
            "a rate beside [control.sampling]",
            "one of them: a torque that is held changes in steps",
        )
    for i, table in enumerate(filters if isinstance(filters, list) else ()):
        joints = table.get("joints") if isinstance(table, dict) else None
        for joint in joints if isinstance(joints, list) else ():
            if isinstance(joint, int) and joint > powered:
                yield Problem(f"control.filters.{i}.joints", f"joint {joint}", f"numbers from 1 to {powered}")


def _one_each(key: str, values: Any, wanted: int, what: str) -> Iterator[Problem]:
    """A list must hold as many numbers as there are things of a kind."""
    if isinstance(values, list) and len(values) != wanted:
        yield Problem(key, counted(len(values), "number"), f"{wanted}, one for each {what}")


def loop_contradictions(links: Sequence[RawTable], loops: Sequence[RawTable], model: Any) -> Iterator[Problem]:
    """List what does not fit in raw tables of links and loops."""
    if model is not None and loops:
        yield Problem(
            "loops", f"{counted(len(loops), 'table')} beside model = {model!r}", "loops only beside [[links]]"
        )
        return
    names = [link.get("name") for link in links]
    for i, link in enumerate(links):
        yield from _parent(f"links.{i}.parent", link, names, i)
        yield from _passive(f"links.{i}", link, bool(loops))
    if loops and not any(link.get("passive") is True for link in links):
        yield Problem("loops", counted(len(loops), "table"), "links with passive = true, whose joints the loops move")
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


COORDINATE = re.compile(r"(q|w|theta|phi|beta)\w*\d(_rate)?")
"""What names of coordinates of a chain, and of their rates, look like."""


def contradictions(raw: dict[str, Any]) -> list[Problem]:
    """List where the tables of a raw scene do not fit each other; lists too long to be looked at are the schema's to refuse."""
    if any(isinstance(raw.get(key), list) and len(raw[key]) > MOST_ITEMS for key in ("links", "loops", "designs")):
        return []
    return [*_links(raw), *_joint_counts(raw), *_designs(raw)]


def _links(raw: dict[str, Any]) -> Iterator[Problem]:
    links, model = tables_in(raw.get("links")), raw.get("model")
    if model is None and not links:
        yield Problem("links", "none", "at least one [[links]] table, or model = the name of a registered model")
    if model is not None and links:
        yield Problem("links", f"{counted(len(links), 'table')} beside model = {model!r}", "either links or a model")
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
        bodies = " or ".join(name for name, effect in known_effects().items() if effect.inertia_keys)
        expected = f"a positive number, or an effect that gives the last link inertia ({bodies})"
        yield Problem(f"links.{len(links) - 1}.mass_per_length", "0", expected)
    motion = _table(raw, "motion")
    tables = iter([{"drive": motion.get("drive", "torque"), **joint} for joint in tables_in(motion.get("joints"))])
    arm = RawArm(links, [next(tables, {}) if driven(link) else {} for link in links])
    yield from link_contradictions(arm)
    yield from loop_contradictions(links, tables_in(raw.get("loops")), model)
    yield from effect_contradictions(_table(raw, "effects"), arm)


def _has_mass(link: dict[str, Any], raw: dict[str, Any]) -> bool:
    """Whether a link at the end, with what it carries, has inertia; unknown counts as yes."""
    effects = _table(raw, "effects")
    own = link.get("mass_per_length", 0 if "body" in link else None) != 0
    body = link["body"].get("mass") != 0 if isinstance(link.get("body"), dict) else False
    return own or body or any(effect.gives_inertia(effects[name]) for name, effect in tables_on(effects))


def _joint_counts(raw: dict[str, Any]) -> Iterator[Problem]:
    links = tables_in(raw.get("links"))
    motion = _table(raw, "motion")
    joints = motion.get("joints")
    if not links or not isinstance(joints, list):
        return
    moving = sum(driven(link) for link in links)
    if len(joints) not in ({0, moving} if motion.get("kind") in ("table", "tip-path") else {moving}):
        but = " that is not passive" if any(link.get("passive") is True for link in links) else ""
        yield Problem("motion.joints", counted(len(joints), "table"), f"{moving}, one for each link's joint{but}")
        return
    default = motion.get("drive", "torque")
    powered = sum(joint.get("drive", default) == "torque" for joint in tables_in(joints))
    yield from control_contradictions(_table(raw, "control"), powered)
    coordinates = powered + _added_coordinates(links, raw)
    for i, design in enumerate(tables_in(raw.get("designs"))):
        state, effort = design.get("state_weight"), design.get("input_weight")
        yield from _one_each(f"designs.{i}.state_weight", state, 2 * coordinates, "state")
        yield from _one_each(f"designs.{i}.input_weight", effort, powered, "torque-driven joint")


def _added_coordinates(links: list[dict[str, Any]], raw: dict[str, Any]) -> int:
    """How many coordinates there are beside the driven joints: modes, free motors, two of each bearing that gives."""
    modes, effects = [count for link in links for count in mode_counts(link).values()], _table(raw, "effects")
    own, moving = ([i for i, link in enumerate(links) if rule(link)] for rule in (driven, moves))
    on = list(tables_on(effects))
    motors = max((count_soft(effects[name], own) for name, effect in on if effect.frees_motors), default=0)
    bearings = max((count_soft(effects[name], moving) for name, effect in on if effect.frees_bearings), default=0)
    return sum(modes) + motors + 2 * bearings


def _designs(raw: dict[str, Any]) -> Iterator[Problem]:
    """Names that stand twice, and keys of weights that are neither a group nor like a coordinate of a chain.

    A registered model may name coordinates of its own.
    """
    groups, designs = list(Weights.model_fields), tables_in(raw.get("designs"))
    names = [design.get("name") for design in designs]
    for i, design in enumerate(designs):
        if names[i] in names[:i]:
            yield Problem(f"designs.{i}.name", f"{names[i]!r} a second time", "a name of its own")
        weights = design.get("weights") if raw.get("model") is None else None
        for key in weights if isinstance(weights, dict) else ():
            if key not in groups and not COORDINATE.fullmatch(str(key)):
                hint = hint_at(str(key), groups)
                expected = f"one of {', '.join(groups)}, or a coordinate such as q1, w11, w11_rate{hint}"
                yield Problem(f"designs.{i}.weights.{printable(key)}", "an unknown key", expected)


def _table(raw: RawTable, key: str) -> RawTable:
    """A raw table in another; anything else is the schema's to complain about."""
    return raw[key] if isinstance(raw.get(key), dict) else {}


def tables_in(value: object) -> list[dict[str, Any]]:
    """The tables in a raw list; anything else is the schema's to complain about."""
    return [table for table in value if isinstance(table, dict)] if isinstance(value, list) else []
