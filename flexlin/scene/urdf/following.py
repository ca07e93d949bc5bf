"""Joints that follow others: each rule traced to a joint of the chain that moves by itself."""

from dataclasses import dataclass

from flexlin.scene.urdf.robot import Robot, UrdfJoint


@dataclass(frozen=True)
class Rule:
    """q = multiplier * q of the joint `leader` + offset."""

    leader: str
    multiplier: float = 1.0
    offset: float = 0.0

    def behind(self, other: "Rule") -> "Rule":
        """The rule of a joint whose leader follows `other`'s."""
        return Rule(other.leader, self.multiplier * other.multiplier, self.multiplier * other.offset + self.offset)


def trace_rule(robot: Robot, joint: UrdfJoint) -> Rule:
    """The rule by which a joint follows one that follows no other. Raises: SceneError for joints that follow each other."""
    rule, seen = Rule(joint.name), {joint.name}
    while (mimic := robot.joints[rule.leader].mimic) is not None:
        if mimic.joint in seen:
            raise joint.element.refuse("joints that mimic each other in a circle", "one that follows no other")
        seen.add(mimic.joint)
        rule = rule.behind(Rule(mimic.joint, mimic.multiplier, mimic.offset))
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
