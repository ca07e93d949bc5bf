"""A chain of a robot as the tables of a scene: joints followed from base to tip, fixed ones merged, bodies added up, frames composed."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexlin.errors import Problem, SceneError
from flexlin.scene.urdf.robot import POINT_INERTIA, Robot, Rule, UrdfJoint, UrdfLink

Array = NDArray[np.float64]
ENTRIES = {
    row + column: ("xyz".index(row), "xyz".index(column)) for row, column in ("xx", "yy", "zz", "xy", "xz", "yz")
}
MOVES = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
"""What a scene calls the joints that move."""
ROUNDING = 1e-15


@dataclass
class Mass:
    """A rigid body that others are added to: mass, first moment and inertia about the origin."""

    mass: float = 0.0
    first: Array = field(default_factory=lambda: np.zeros(3))
    second: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def add(self, mass: float, inertia: Array, rotation: Array, centre: Array) -> None:
        """Add a body with its centre, and its inertia about it in axes turned by `rotation`."""
        shifted = centre @ centre * np.eye(3) - np.outer(centre, centre)
        self.mass += mass
        self.first = self.first + mass * centre
        self.second = self.second + rotation @ inertia @ rotation.T + mass * shifted

    def table(self) -> dict[str, Any]:
        """The body as a table of a scene's link."""
        c = self.first / self.mass if self.mass else np.zeros(3)
        J = self.second - self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        size = np.abs(self.second).max() + POINT_INERTIA / ROUNDING * self.mass
        inertia = {key: tidy(J[place], size) for key, place in ENTRIES.items()}
        inertia |= {key: max(inertia[key], 0.0) for key in ("xx", "yy", "zz")}
        return {"mass": self.mass, "centre": as_numbers(c), "inertia": inertia}


def add_link(mass: Mass, link: UrdfLink, rotation: Array, place: Array) -> None:
    """Add a link whose frame lies at `place`, turned by `rotation`.

    Raises: SceneError, naming the line, for a negative principal inertia, but for rounding.
    """
    own = np.zeros((3, 3))
    for key, (i, j) in ENTRIES.items():
        own[i, j] = own[j, i] = link.inertia.get(key, 0.0)
    least = min(float(np.linalg.eigvalsh(own).min()) + 1e-9 * np.abs(own).max(), own.diagonal().min())
    if least < -POINT_INERTIA * link.mass:
        matrix = link.element.all("inertial")[0].all("inertia")[0]
        raise matrix.refuse(f"a matrix with a negative principal inertia in the chain, of {link.name!r}", "an inertia")
    mass.add(link.mass, own, rotation @ rotation_of(link.rpy), place + rotation @ np.array(link.centre))


def tidy(value: float, size: float) -> float:
    """A number without the decimals that are rounding of numbers of some size."""
    least = 10 * ROUNDING * size
    return round(float(value), math.floor(-math.log10(least))) if abs(value) > least else 0.0


def rotation_of(rpy: tuple[float, ...]) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), with zeros for what is only rounding of quarter turns."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    R = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return np.where(np.abs(R) < ROUNDING, 0.0, R)


def angles_of(R: Array) -> list[float]:
    """Roll, pitch and yaw of a rotation; the roll undoes what the yaw says, so that a pitch near a quarter turn loses nothing."""
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    yaw = float(np.arctan2(R[1, 0], R[0, 0])) if flat > ROUNDING else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    roll = float(np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]))
    return as_numbers((roll, float(np.arctan2(-R[2, 0], flat)), yaw))


def as_numbers(values: Iterable[float]) -> list[float]:
    """Numbers as a list, with 0 for minus 0."""
    return [float(value) + 0.0 for value in values]


def choose_chain(robot: Robot, base: str | None, tip: str | None) -> list[UrdfJoint]:
    """The joints from the base to the tip."""
    behind = {joint.child: joint for joint in robot.joints.values()}
    parents = {joint.parent for joint in robot.joints.values()}
    roots, ends = [n for n in robot.links if n not in behind], [n for n in robot.links if n not in parents]
    base = choose("base", base, roots, robot)
    ways = {end: way for end in ends if end != base and (way := list_joints(base, end, behind)) is not None}
    moved = [end for end, way in ways.items() if any(joint.kind != "fixed" for joint in way)]
    tip = choose("tip", tip, moved or list(ways), robot)
    joints = list_joints(base, tip, behind)
    if joints is None:
        raise SceneError(robot.element.source, [Problem("tip", repr(tip), f"a link behind {base!r}")])
    if not any(joint.kind != "fixed" for joint in joints):
        raise robot.element.refuse(f"no joint that moves from {base!r} on", "a chain of joints")
    for joint in joints:
        if joint.kind in ("floating", "planar"):
            raise joint.element.refuse(f"type {joint.kind!r} in the chain", "revolute, continuous, prismatic or fixed")
    return joints


def list_joints(base: str, tip: str, behind: dict[str, UrdfJoint]) -> list[UrdfJoint] | None:
    """The joints from a link to one behind it; None where it is not behind."""
    joints = list[UrdfJoint]()
    while tip != base:
        if tip not in behind:
            return None
        joints.insert(0, behind[tip])
        tip = behind[tip].parent
    return joints


def choose(key: str, given: str | None, possible: list[str], robot: Robot) -> str:
    """A link by name, or the only one possible."""
    if given is None and len(possible) == 1:
        return possible[0]
    if given is None or given not in robot.links:
        some = f", such as {', '.join(possible[:20])}" if possible else " behind a joint that moves"
        got = f"{len(possible)} possible links" if given is None else repr(given)[:80]
        raise SceneError(robot.element.source, [Problem(key, got, f"{key} = one link of the file{some}")])
    return given


def trace_rule(robot: Robot, joint: UrdfJoint) -> Rule:
    """The rule by which a joint follows one that follows no other. Raises: SceneError for joints that follow each other."""
    rule, seen = Rule(joint.name), {joint.name}
    while (mimic := robot.joints[rule.leader].mimic) is not None:
        if mimic.leader in seen:
            raise joint.element.refuse("joints that mimic each other in a circle", "one that follows no other")
        seen.add(mimic.leader)
        rule = rule.behind(mimic)
    return rule


def trace_rules(robot: Robot, moving: list[UrdfJoint]) -> tuple[dict[str, Rule], list[str]]:
    """The rules of the joints of a chain that follow another of it, and notes on those whose leader stands beside it.

    Where the leader moves beside the chain, the first joint that follows it moves by itself, and others follow this one.
    Raises: SceneError where a leader comes later in the chain.
    """
    rules, first, notes = dict[str, Rule](), dict[str, Rule](), list[str]()
    names, before = [joint.name for joint in moving], set[str]()
    for joint in moving:
        rule = trace_rule(robot, joint)
        if rule.leader in before:
            rules[joint.name] = rule
        elif rule.leader in names and rule.leader != joint.name:
            raise joint.element.refuse(f"mimic of {rule.leader!r}", "a joint before it in the chain")
        elif rule.leader in first:
            rules[joint.name] = rule.behind(first[rule.leader])
        elif rule.leader != joint.name:
            if not rule.multiplier:
                raise joint.element.refuse(
                    "multiplier 0 of a joint beside the chain", "a number other than 0, or a fixed joint"
                )
            first[rule.leader] = Rule(joint.name, 1 / rule.multiplier, -rule.offset / rule.multiplier)
            notes.append(f"{joint.name} moves by itself, because {rule.leader} is not in the chain")
        before.add(joint.name)
    return rules, notes


@dataclass(frozen=True)
class ChainTables:
    """The raw tables of a chain: a link for each joint that moves, and one for a tip that lies off the last of them.

    children: the URDF link behind each joint that moves; free: the joints that follow no other; effects; what was not read.
    """

    links: list[dict[str, Any]]
    children: list[str]
    free: list[UrdfJoint]
    effects: dict[str, Any]
    notes: list[str]


def scene_tables(robot: Robot, base: str | None = None, tip: str | None = None) -> dict[str, Any]:
    """The raw tables of a scene of a chain that stands still."""
    chain = chain_tables(robot, base, tip)
    if not any(link["body"]["mass"] for link in chain.links[len(chain.children) - 1 :]):
        element = robot.links[chain.children[-1]].element
        raise element.refuse("no mass behind the last joint", "an <inertial> with mass, or a tip before it")
    tables = {
        "schema": 1,
        "title": robot.name or "A robot from URDF",
        "source": "; ".join(("URDF", *chain.notes)),
        "links": chain.links,
        "effects": chain.effects,
        "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [stand_still(joint) for joint in chain.free]},
    }
    drives = list_drives(chain.free)
    return {**tables, "drives": drives} if drives else tables


def stand_still(joint: UrdfJoint) -> dict[str, Any]:
    """The motion of a joint that stands still within its limits."""
    lower, upper = (joint.limits.get(key, 0.0) for key in ("lower", "upper"))
    allowed = joint.kind == "continuous" or lower <= 0 <= upper
    return {"amplitude": 0.0} if allowed else {"mean": (lower + upper) / 2, "amplitude": 0.0}


def list_drives(joints: list[UrdfJoint]) -> dict[str, Any]:
    """The limits of torque and of speed, as far as every joint states them."""
    efforts, speeds = ([joint.limits.get(key, 0.0) for joint in joints] for key in ("effort", "velocity"))
    torque = {"torque": {"peak": efforts}} if all(effort > 0 for effort in efforts) else {}
    return {**torque, "speed": speeds} if all(speed > 0 for speed in speeds) else torque


def chain_tables(robot: Robot, base: str | None = None, tip: str | None = None) -> ChainTables:
    """The raw tables of a chain; what stands still before the first joint that moves has no body."""
    joints = choose_chain(robot, base, tip)
    moving = [joint for joint in joints if joint.kind != "fixed"]
    rules, notes = trace_rules(robot, moving)
    behind = joints.index(moving[-1]) + 1
    links, R, p = list[dict[str, Any]](), np.eye(3), np.zeros(3)
    along = {joint.name for joint in joints}
    mass: Mass | None = None
    left = add_rigid(robot, robot.links[joints[0].parent], None, along, np.eye(3), np.zeros(3))
    for joint in joints[:behind]:
        p, R = p + R @ np.array(joint.xyz), R @ rotation_of(joint.rpy)
        if joint.kind != "fixed":
            mass = Mass()
            kind, mount = MOVES[joint.kind], {"xyz": as_numbers(p), "rpy": angles_of(R)}
            links.append({"name": joint.name, "joint": kind, "axis": as_numbers(joint.axis), "mount": mount})
            R, p = np.eye(3), np.zeros(3)
        left += add_rigid(robot, robot.links[joint.child], mass, along, R, p)
        if mass is not None:
            links[-1]["body"] = mass.table()
    assert mass is not None
    left += add_tip(robot, joints[behind:], mass, along, links)
    names = [joint.name for joint in moving]
    for name, rule in rules.items():
        of = {"link": names.index(rule.leader), "multiplier": rule.multiplier, "offset": rule.offset}
        links[names.index(name)]["mimic"] = of
    notes = [*robot.notes, *notes, *([f"left out: {', '.join(left)}"] if left else [])]
    free = [joint for joint in moving if joint.name not in rules]
    return ChainTables(links, [joint.child for joint in moving], free, effect_tables(moving, rules, len(links)), notes)


def add_tip(
    robot: Robot, joints: list[UrdfJoint], mass: Mass, along: set[str], links: list[dict[str, Any]]
) -> list[str]:
    """Add the bodies at the tip, on a link of their own where the tip lies off the last joint; returns what moves beside them."""
    places, R, p = list[tuple[UrdfJoint, Array, Array]](), np.eye(3), np.zeros(3)
    for joint in joints:
        p, R = p + R @ np.array(joint.xyz), R @ rotation_of(joint.rpy)
        places.append((joint, R, p))
    if p.any() or (np.eye(3) != R).any():
        mass = Mass()
        links.append({"name": joints[-1].name, "joint": "fixed", "mount": {"xyz": as_numbers(p), "rpy": angles_of(R)}})
    left = list[str]()
    for joint, turn, place in places:
        left += add_rigid(robot, robot.links[joint.child], mass, along, R.T @ turn, R.T @ (place - p))
    links[-1]["body"] = mass.table()
    return left


def effect_tables(moving: list[UrdfJoint], rules: Mapping[str, Rule], links: int) -> dict[str, Any]:
    """Gravity, and friction where the file states any; that of a joint that follows another acts on this one.

    With q = m q0 + o the power d q'^2 is d m^2 q0'^2, and r |q'| is r |m| |q0'|.
    """
    names = [joint.name for joint in moving]
    damping, friction = np.zeros((2, links))
    for joint in moving:
        rule = rules.get(joint.name, Rule(joint.name))
        at = names.index(rule.leader)
        damping[at] += joint.damping * rule.multiplier**2
        friction[at] += joint.friction * abs(rule.multiplier)
    effects: dict[str, Any] = {"gravity": {"acceleration": 9.81, "direction": [0.0, 0.0, -1.0]}}
    if damping.any():
        effects["viscous_friction"] = {"coefficient": damping.tolist()}
    if friction.any():
        effects["coulomb_friction"] = {"torque": friction.tolist()}
    return effects


def add_rigid(robot: Robot, link: UrdfLink, mass: Mass | None, along: set[str], R: Array, p: Array) -> list[str]:
    """Add a link and all that hangs on it by fixed joints beside the chain to a body that moves; returns the joints beside it that move."""
    left, waiting = list[str](), [(link, R, p)]
    while waiting:
        link, R, p = waiting.pop()
        if mass is not None:
            add_link(mass, link, R, p)
        for joint in robot.joints.values():
            if joint.parent == link.name and joint.name not in along:
                if joint.kind == "fixed":
                    place = p + R @ np.array(joint.xyz)
                    waiting.append((robot.links[joint.child], R @ rotation_of(joint.rpy), place))
                else:
                    left.append(f"{joint.name} and what is behind it")
    return left
