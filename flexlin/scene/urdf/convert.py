"""A chain of a robot as the tables of a scene: fixed joints merged, bodies added up, frames composed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexlin.scene.urdf.bodies import Array, Mass, angles_of, as_numbers, rotation_of
from flexlin.scene.urdf.chain import choose_chain
from flexlin.scene.urdf.following import Rule, trace_rules
from flexlin.scene.urdf.robot import Robot, UrdfJoint, UrdfLink

GRAVITY = {"acceleration": 9.81, "direction": [0.0, 0.0, -1.0]}


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
    """The raw tables of a chain."""
    joints = choose_chain(robot, base, tip)
    moving = [joint for joint in joints if joint.kind != "fixed"]
    rules, notes = trace_rules(robot, moving)
    behind = joints.index(moving[-1]) + 1
    links, R, p, mass = list[dict[str, Any]](), np.eye(3), np.zeros(3), Mass()
    along = {joint.name for joint in joints}
    left = add_rigid(robot, robot.links[joints[0].parent], Mass(), along, np.eye(3), np.zeros(3))
    for joint in joints[:behind]:
        p, R = p + R @ np.array(joint.xyz), R @ rotation_of(joint.rpy)
        if joint.kind != "fixed":
            mass = Mass()
            links.append(link_table(joint, R, p))
            R, p = np.eye(3), np.zeros(3)
        left += add_rigid(robot, robot.links[joint.child], mass, along, R, p)
        if links:
            links[-1]["body"] = mass.table()
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


def link_table(joint: UrdfJoint, R: Array, p: Array) -> dict[str, Any]:
    """The table of the link behind a joint that moves, without its body."""
    kind = "prismatic" if joint.kind == "prismatic" else "revolute"
    mount = {"xyz": as_numbers(p), "rpy": angles_of(R)}
    return {"name": joint.name, "joint": kind, "axis": as_numbers(joint.axis), "mount": mount}


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
    effects: dict[str, Any] = {"gravity": dict(GRAVITY)}
    if damping.any():
        effects["viscous_friction"] = {"coefficient": damping.tolist()}
    if friction.any():
        effects["coulomb_friction"] = {"torque": friction.tolist()}
    return effects


def add_rigid(robot: Robot, link: UrdfLink, mass: Mass, along: set[str], R: Array, p: Array) -> list[str]:
    """Add a link and all that hangs on it by fixed joints beside the chain; returns the joints beside it that move."""
    left, waiting = list[str](), [(link, R, p)]
    while waiting:
        link, R, p = waiting.pop()
        mass.add(link, R, p)
        for joint in robot.joints.values():
            if joint.parent == link.name and joint.name not in along:
                if joint.kind == "fixed":
                    place = p + R @ np.array(joint.xyz)
                    waiting.append((robot.links[joint.child], R @ rotation_of(joint.rpy), place))
                else:
                    left.append(f"{joint.name} and what is behind it")
    return left
