"""A chain of a robot as the tables of a scene: fixed joints merged, bodies added up, frames composed."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexlin.errors import Problem, SceneError
from flexlin.scene.urdf.robot import Robot, UrdfJoint, UrdfLink, read_robot

if TYPE_CHECKING:
    from flexlin.scene.scene import Scene

Array = NDArray[np.float64]
ENTRIES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
ROUNDING = 1e-15
GRAVITY = {"acceleration": 9.81, "direction": [0.0, 0.0, -1.0]}


@dataclass(frozen=True)
class ChainTables:
    """The raw tables of a chain: a link for each joint that moves, with the name of its URDF link; effects; what was not read."""

    links: list[dict[str, Any]]
    children: list[str]
    effects: dict[str, Any]
    notes: list[str]


@dataclass
class Mass:
    """A rigid body that others are added to: mass, first moment and inertia about the origin."""

    mass: float = 0.0
    first: Array = field(default_factory=lambda: np.zeros(3))
    second: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def add(self, link: UrdfLink, rotation: Array, place: Array) -> None:
        """Add a link whose frame lies at `place`, turned by `rotation`."""
        turn = rotation @ rotation_of(link.rpy)
        c = place + rotation @ np.array(link.centre)
        own = np.zeros((3, 3))
        for key, (i, j) in ENTRIES.items():
            own[i, j] = own[j, i] = link.inertia.get(key, 0.0)
        self.mass += link.mass
        self.first = self.first + link.mass * c
        self.second = self.second + turn @ own @ turn.T + link.mass * (c @ c * np.eye(3) - np.outer(c, c))

    def table(self) -> dict[str, Any]:
        """The body as a table of a scene's link."""
        c = self.first / self.mass if self.mass else np.zeros(3)
        J = self.second - self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        size = np.abs(self.second).max()
        inertia = {key: tidy(J[place], size) for key, place in ENTRIES.items()}
        inertia |= {key: max(inertia[key], 0.0) for key in ("xx", "yy", "zz")}
        return {"mass": self.mass, "centre": [float(x) for x in c], "inertia": inertia}


def tidy(value: float, size: float) -> float:
    """A number, or zero where it is rounding of numbers of some size."""
    return float(value) if abs(value) > 10 * ROUNDING * size else 0.0


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
    """Roll, pitch and yaw of a rotation; no roll where the pitch is a quarter turn."""
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = float(np.arctan2(-R[2, 0], flat))
    if flat < 1e-12:
        return [0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1]))]
    return [float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0]))]


def scene_from_urdf(path: str | Path, base: str | None = None, tip: str | None = None) -> "Scene":
    """Make a scene of a chain of a robot from its URDF file.

    Joints, axes, origins, inertias, damping, friction and mimicked joints are read; fixed joints are merged, links that hang on the chain
    by fixed joints are added to it. Gravity points along -z of the base. Each joint stands still; give the scene a motion.

    Parameters
    ----------
    path : str or Path
        The file; no mesh and no other file is read.
    base, tip : str, optional
        Names of the first and the last link; by default the root, and the only end of the tree.

    Returns
    -------
    Scene
        A frozen, checked scene; its `source` says what was read and what not.

    Raises
    ------
    SceneError
        Naming the line where the file is at fault.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.scene.library import models_folder
    >>> scene = fl.scene_from_urdf(models_folder() / "manutec-r3.urdf")
    >>> len(scene.links), scene.links[1].name
    (6, 'axis_2')
    """
    from flexlin.scene.loading import parse_scene

    robot = read_robot(path)
    return parse_scene(scene_tables(robot, base, tip), str(path))


def scene_tables(robot: Robot, base: str | None = None, tip: str | None = None) -> dict[str, Any]:
    """The raw tables of a scene of a chain that stands still."""
    chain = chain_tables(robot, base, tip)
    moving = sum("mimic" not in link for link in chain.links)
    return {
        "schema": 1,
        "title": robot.name or "A robot from URDF",
        "source": "; ".join(("URDF", *chain.notes)),
        "links": chain.links,
        "effects": chain.effects,
        "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.0}] * moving},
    }


def chain_tables(robot: Robot, base: str | None = None, tip: str | None = None) -> ChainTables:
    """The raw tables of a chain."""
    joints = choose_chain(robot, base, tip)
    moving = [joint for joint in joints if joint.kind != "fixed"]
    links, R, p, mass = list[dict[str, Any]](), np.eye(3), np.zeros(3), Mass()
    start = joints[0].parent
    along = {joint.name for joint in joints}
    left = add_rigid(robot, robot.links[start], Mass(), along, np.eye(3), np.zeros(3))
    for joint in joints:
        p, R = p + R @ np.array(joint.xyz), R @ rotation_of(joint.rpy)
        if joint.kind != "fixed":
            mass = Mass()
            links.append(link_table(joint, moving, R, p, mass))
            R, p = np.eye(3), np.zeros(3)
        left += add_rigid(robot, robot.links[joint.child], mass, along, R, p)
        if links:
            links[-1]["body"] = mass.table()
    notes = [*robot.notes, *([f"left out: {', '.join(left)}"] if left else [])]
    return ChainTables(links, [joint.child for joint in moving], effect_tables(moving), notes)


def link_table(joint: UrdfJoint, moving: list[UrdfJoint], R: Array, p: Array, mass: Mass) -> dict[str, Any]:
    """The table of the link behind a joint that moves."""
    kind = "prismatic" if joint.kind == "prismatic" else "revolute"
    mount = {"xyz": p.tolist(), "rpy": angles_of(R)}
    table: dict[str, Any] = {
        "name": joint.name,
        "joint": kind,
        "axis": list(joint.axis),
        "mount": mount,
        "body": mass.table(),
    }
    if joint.mimic is not None:
        names = [other.name for other in moving]
        before = names[: names.index(joint.name)]
        if joint.mimic.joint not in before or moving[names.index(joint.mimic.joint)].mimic is not None:
            raise joint.element.refuse(
                f"mimic of {joint.mimic.joint!r}", "a joint before it in the chain that follows no other"
            )
        rule: dict[str, Any] = {"multiplier": joint.mimic.multiplier, "offset": joint.mimic.offset}
        table["mimic"] = {"link": before.index(joint.mimic.joint), **rule}
    return table


def effect_tables(moving: list[UrdfJoint]) -> dict[str, Any]:
    """Gravity, and friction where the file states any."""
    effects: dict[str, Any] = {"gravity": dict(GRAVITY)}
    if any(joint.damping for joint in moving):
        effects["viscous_friction"] = {"coefficient": [joint.damping for joint in moving]}
    if any(joint.friction for joint in moving):
        effects["coulomb_friction"] = {"torque": [joint.friction for joint in moving]}
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


def choose_chain(robot: Robot, base: str | None, tip: str | None) -> list[UrdfJoint]:
    """The joints from the base to the tip."""
    behind = {joint.child: joint for joint in robot.joints.values()}
    parents = {joint.parent for joint in robot.joints.values()}
    roots, ends = [n for n in robot.links if n not in behind], [n for n in robot.links if n not in parents]
    base = choose("base", base, roots, robot)
    reached = [end for end in ends if end != base and base in list_ancestors(end, behind)]
    tip = choose("tip", tip, reached, robot)
    if base != tip and base not in list_ancestors(tip, behind):
        raise SceneError(robot.element.source, [Problem("tip", repr(tip), f"a link behind {base!r}")])
    joints = list[UrdfJoint]()
    while tip != base:
        joints.insert(0, behind[tip])
        tip = behind[tip].parent
    if not any(joint.kind != "fixed" for joint in joints):
        raise robot.element.refuse(f"no joint that moves from {base!r} on", "a chain of joints")
    for joint in joints:
        if joint.kind in ("floating", "planar"):
            raise joint.element.refuse(f"type {joint.kind!r} in the chain", "revolute, continuous, prismatic or fixed")
    return joints


def list_ancestors(name: str, behind: dict[str, UrdfJoint]) -> set[str]:
    """The links that a link hangs on."""
    found = set()
    while name in behind:
        name = behind[name].parent
        found.add(name)
    return found


def choose(key: str, given: str | None, possible: list[str], robot: Robot) -> str:
    """A link by name, or the only one possible."""
    if given is None and len(possible) == 1:
        return possible[0]
    if given is None or given not in robot.links:
        some = ", ".join(possible[:20]) or "none"
        got = f"{len(possible)} possible links" if given is None else repr(given)[:80]
        raise SceneError(robot.element.source, [Problem(key, got, f"{key} = one link of the file, such as {some}")])
    return given
