"""From the tables of a scene that name a robot's URDF file to links and effects."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.bounds import printable
from flexlin.errors import Problem, SceneError
from flexlin.scene.library import place_below
from flexlin.scene.problems import read_table
from flexlin.scene.scene import FlexibleTable, JointTable, RobotTable
from flexlin.scene.urdf.convert import ChainTables, angles_of, as_numbers, chain_tables, rotation_of
from flexlin.scene.urdf.robot import read_robot


def expand_robot(data: dict[str, Any], folders: Sequence[Path]) -> list[Problem]:
    """Put the links and effects of the robot in the place of the tables [robot], [joints] and [flexible].

    Effects that the scene states itself stay as they are. Returns the problems; raises SceneError where the file is at fault.
    """
    robot = data.pop("robot", None)
    joints, flexible = (data.pop(key, {}) for key in ("joints", "flexible"))
    if robot is None:
        added = {"joints": joints, "flexible": flexible}
        return [Problem(key, "a table without [robot]", '[robot] urdf = "..."') for key in added if added[key]]
    problems: list[Problem] = []
    table = read_table(RobotTable, robot, "robot", problems)
    own = {
        name: read_table(JointTable, joint, f"joints.{printable(name)}", problems)
        for name, joint in pairs(joints, "joints", problems)
    }
    if data.get("links"):
        problems.append(Problem("links", "links beside [robot]", "either [[links]] or [robot]"))
    path = None if table is None else find_file(table.urdf, folders, problems)
    if path is None or problems:
        data.setdefault("links", [{"body": {"mass": 1.0}}])
        return problems
    try:
        chain = chain_tables(read_robot(path), table.base, table.tip)
    except SceneError as fault:
        named = [Problem(f"robot.urdf: {problem.key}", problem.got, problem.expected) for problem in fault.problems]
        raise SceneError(fault.source, named) from None
    problems += bend_links(chain, dict(pairs(flexible, "flexible", problems)))
    problems += add_springs(chain, own)
    data["links"] = chain.links
    stated = data.get("effects")
    if stated is None or isinstance(stated, dict):
        data["effects"] = {**chain.effects, **(stated or {})}
    data.setdefault("source", "; ".join(("URDF", *chain.notes)))
    return problems


def pairs(tables: Any, key: str, problems: list[Problem]) -> list[tuple[str, Any]]:
    """The tables of a table."""
    if isinstance(tables, Mapping) and all(isinstance(table, Mapping) for table in tables.values()):
        return list(tables.items())
    problems.append(Problem(key, "something else than tables", f"a table [{key}.NAME] for each name"))
    return []


def find_file(name: str, folders: Sequence[Path], problems: list[Problem]) -> Path | None:
    """The first file of that name below one of the folders."""
    found = place_below(name, folders)
    if found is None or not found.is_file():
        expected = "a URDF file below the scene's folder, or below --data DIR"
        problems.append(Problem("robot.urdf", printable(repr(name))[:80], expected))
        return None
    return found


def add_springs(chain: ChainTables, joints: Mapping[str, JointTable]) -> list[Problem]:
    """Make the effect of flexible joints of their tables, with all figures on the link's side of the gear."""
    names = [link["name"] for link in chain.links]
    moving = names[: len(chain.children)]
    unknown = [name for name in joints if name not in moving]
    if unknown:
        expected = f"a joint of the chain that moves: {', '.join(moving[:20])}"
        return [Problem(f"joints.{printable(name)}", "an unknown joint", expected) for name in unknown]
    own = [joints.get(name, JointTable()) for name in names]
    if any(joint.stiffness or joint.motor_inertia for joint in own):
        chain.effects["joint_flexibility"] = {
            "stiffness": [(joint.stiffness or 0.0) * joint.gear**2 for joint in own],
            "motor_inertia": [joint.motor_inertia * joint.gear**2 for joint in own],
            "damping": [joint.damping * joint.gear**2 for joint in own],
        }
    return []


def bend_links(chain: ChainTables, flexible: Mapping[str, Any]) -> list[Problem]:
    """Turn rigid links into beams from their joint to the next one, or as long as said."""
    problems: list[Problem] = []
    for name, table in flexible.items():
        if name not in chain.children:
            expected = f"a link behind a joint of the chain that moves: {', '.join(chain.children[:20])}"
            problems.append(Problem(f"flexible.{printable(name)}", "an unknown link", expected))
            continue
        beam = read_table(FlexibleTable, table, f"flexible.{printable(name)}", problems)
        if beam is None:
            continue
        index = chain.children.index(name)
        stated = chain.links[index]["body"]["mass"]
        problem = bend_link(chain, index, beam.model_dump(exclude_unset=True))
        if problem is not None:
            problems.append(problem)
        elif beam.section is not None:
            mass = beam.section.figures()["mass_per_length"] * chain.links[index]["length"]
            chain.notes.append(f"{printable(name)} weighs {mass:.4g} kg by its section, {stated:.4g} kg in the file")
    return problems


def bend_link(chain: ChainTables, index: int, table: Mapping[str, Any]) -> Problem | None:
    """Lay a link's x along its beam: its joint's axis, the mount before it and the one behind it turn with it.

    Returns: what is wrong, where nothing says which way the beam goes.
    """
    link, body = chain.links[index], chain.links[index]["body"]
    after = chain.links[index + 1] if index + 1 < len(chain.links) else None
    key = f"flexible.{chain.children[index]}"
    along = np.array(after["mount"]["xyz"] if after else body["centre"])
    reach = float(np.linalg.norm(along))
    length = table.get("length", reach if after else 2 * reach)
    if not reach:
        expected = "a link whose next joint, or centre, lies off its own joint"
        return Problem(f"{key}.length", repr(length)[:60], expected)
    B = turn_to(along / reach)
    link["mount"]["rpy"] = angles_of(rotation_of(link["mount"]["rpy"]) @ B)
    link["axis"] = as_numbers(B.T @ np.array(link["axis"]))
    own = {} if "section" in table else {"mass_per_length": body["mass"] / length}
    link |= own | {"length": float(length)} | {name: value for name, value in table.items() if name != "length"}
    del link["body"]
    if after:
        after["mount"]["xyz"] = as_numbers(B.T @ along - np.array([length, 0.0, 0.0]))
        after["mount"]["rpy"] = angles_of(B.T @ rotation_of(after["mount"]["rpy"]))
    return None


def turn_to(direction: Any) -> Any:
    """The shortest rotation that takes x to a direction of length 1; half a turn about z where it points backwards."""
    c, axis = direction[0], np.array([0.0, -direction[2], direction[1]])
    if 1 + c < 1e-12:
        return np.diag([-1.0, -1.0, 1.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + cross + cross @ cross / (1 + c)
