"""The joints of a robot between a base and a tip."""

from flexlin.errors import Problem, SceneError
from flexlin.scene.urdf.robot import Robot, UrdfJoint


def choose_chain(robot: Robot, base: str | None, tip: str | None) -> list[UrdfJoint]:
    """The joints from the base to the tip."""
    behind = {joint.child: joint for joint in robot.joints.values()}
    parents = {joint.parent for joint in robot.joints.values()}
    roots, ends = [n for n in robot.links if n not in behind], [n for n in robot.links if n not in parents]
    base = choose("base", base, roots, robot)
    reached = [end for end in ends if end != base and base in list_ancestors(end, behind)]
    moved = [end for end in reached if any(joint.kind != "fixed" for joint in list_joints(base, end, behind))]
    tip = choose("tip", tip, moved or reached, robot)
    if base != tip and base not in list_ancestors(tip, behind):
        raise SceneError(robot.element.source, [Problem("tip", repr(tip), f"a link behind {base!r}")])
    joints = list_joints(base, tip, behind)
    if not any(joint.kind != "fixed" for joint in joints):
        raise robot.element.refuse(f"no joint that moves from {base!r} on", "a chain of joints")
    for joint in joints:
        if joint.kind in ("floating", "planar"):
            raise joint.element.refuse(f"type {joint.kind!r} in the chain", "revolute, continuous, prismatic or fixed")
    return joints


def list_joints(base: str, tip: str, behind: dict[str, UrdfJoint]) -> list[UrdfJoint]:
    """The joints from a link to one behind it."""
    joints = list[UrdfJoint]()
    while tip != base:
        joints.insert(0, behind[tip])
        tip = behind[tip].parent
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
