"""What a log's inputs and sensors are in the arm's equations."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.errors import ArgumentError
from flexlin.identification.log import Log
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.mechanics.manipulator import Manipulator
from flexlin.scene.scene import LogColumn, LogOutput, Scene


@dataclass(frozen=True, eq=False)
class Channel:
    """One column: its name in messages, and reading = (value - offset) / gain of an output, with the delay in s.

    place: the joint's input of a column of torques, -1 of a sensor; value: what a sensor sees of s, s' and s''; lowpass: angular
    frequency and damping ratio of the filter behind it.
    """

    name: str
    gain: ca.SX
    offset: ca.SX
    delay: ca.SX
    value: ca.SX
    place: int = -1
    lowpass: tuple[ca.SX, ca.SX] | None = None


def read_inputs(scene: Scene, arm: Manipulator, log: Log) -> list[Channel]:
    """The columns of torques, forces or voltages, each at its joint; joints without one get none.

    Raises: ArgumentError for a name that is no joint, or two of one joint.
    """
    marked = arm.parameters.placed_in(scene)
    table = {} if marked.log is None else marked.log.inputs
    found: list[Channel] = []
    for name in log.inputs:
        column = table.get(name, LogColumn(column=name))
        place = find_joint(scene, arm, name)
        if place in [one.place for one in found]:
            raise ArgumentError("two inputs of the log are of one joint", got=name, expected="one a joint")
        found.append(Channel(name, *calibration(column), ca.SX(0), place))
    return found


def read_outputs(scene: Scene, arm: Manipulator, log: Log) -> list[Channel]:
    """The sensors, as expressions of s, s' and s''; free numbers are symbols in them. Raises: ArgumentError for one that the arm lacks."""
    marked = arm.parameters.placed_in(scene)
    table = {} if marked.log is None else marked.log.outputs
    found = []
    for name in log.outputs:
        sensor = table.get(name, LogOutput(column=name))
        label = log.columns.get(name, name)
        low = sensor.lowpass
        passed = None if low is None else (2 * np.pi * ca.SX(low.frequency), ca.SX(low.damping))
        found.append(Channel(label, *calibration(sensor), see(scene, arm, name, sensor), lowpass=passed))
    return found


def calibration(column: LogColumn) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Gain, offset and delay."""
    return ca.SX(column.gain), ca.SX(column.offset), ca.SX(column.delay)


def find_joint(scene: Scene, arm: Manipulator, name: str) -> int:
    """The number of a joint by its coordinate (q1) or by the name that the scene gives it."""
    joints = [c for c in arm.coordinates if c.kind == "joint"]
    for k, joint in enumerate(joints):
        link = None if joint.link is None or not scene.links else scene.links[joint.link]
        if name in (joint.name, link.name if link and link.name else None):
            return k
    known = ", ".join(joint.name for joint in joints)
    raise ArgumentError(f"the arm has no joint {name!r}", got=name, expected=f"{known}, or a joint's name in the scene")


def see(scene: Scene, arm: Manipulator, name: str, sensor: LogOutput) -> ca.SX:
    """What a sensor reads, in the scene's units."""
    kind, axis = name_kind(arm, name) if sensor.sensor is None else (sensor.sensor, sensor.axis)
    if kind in ("coordinate", "rate"):
        own = name.removesuffix("_rate")
        if own not in arm.names:
            raise ArgumentError(f"there is no coordinate {own!r}", got=name, expected=", ".join(arm.names))
        return (arm.s if kind == "coordinate" else arm.s_dot)[arm.names.index(own)]
    if kind == "strain":
        return see_curvature(scene, arm, name, sensor)
    if kind == "encoder":
        return (arm.encoders @ arm.s)[find_joint(scene, arm, name) if sensor.link is None else sensor.link]
    if arm.points is None or "xyz".index(axis) >= arm.points.size1():
        raise ArgumentError(
            f"the arm has no tip.{axis}", got=name, expected="tip.x or tip.y of an arm that has a tip in its plane"
        )
    place = arm.points["xyz".index(axis), -1]
    if kind == "tip":
        return place
    rate = ca.jtimes(place, arm.s, arm.s_dot)
    return ca.jtimes(rate, arm.s, arm.s_dot) + ca.jtimes(rate, arm.s_dot, arm.s_ddot)


def name_kind(arm: Manipulator, name: str) -> tuple[str, str]:
    """What an output is by its name, and its axis."""
    if name in arm.names:
        return "coordinate", ""
    if name.removesuffix("_rate") in arm.names:
        return "rate", ""
    for kind, word in (("tip", "tip."), ("tip-acceleration", "tip_acceleration.")):
        if name in [word + axis for axis in "xyz"]:
            return kind, name[-1]
    return "encoder", ""


def see_curvature(scene: Scene, arm: Manipulator, name: str, sensor: LogOutput) -> ca.SX:
    """Curvature of a link at a place, sum_k X_k''(x/l) / l^2 w_k, in 1/m."""
    link = sensor.link
    own = [k for k, c in enumerate(arm.coordinates) if (c.kind, c.link, c.direction) == ("elastic", link, "y")]
    if link is None or not own:
        raise ArgumentError(
            f"{name} is a strain gauge on no flexible link", got=f"link = {link}", expected="the number of one, from 0"
        )
    shapes = make_shapes(scene, link).values(np.array([sensor.at]), 2)[:, 0]
    return ca.dot(ca.DM(shapes), arm.s[own]) / arm.parameters.placed_in(scene).links[link].length ** 2
