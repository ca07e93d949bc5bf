"""Bearings that give: what stands between a joint's mount and its displacement."""

import casadi as ca

from flexlin.mechanics.frames import Frame, X, Y, Z, directions_across
from flexlin.mechanics.links import split_rotation
from flexlin.scene.links import Link


def pass_bearing(frame: Frame, link: Link, axis: ca.SX, give: ca.SX, rate: ca.SX) -> Frame:
    """The frame in which a joint turns or slides: tilted about the axes across it, or moved across it, by `give` (2, 1).

    What does not give has no entries. The tilt is exp((e_1 beta_1 + e_2 beta_2)~) to second order.
    """
    if not give.numel():
        return frame
    directions = directions_across(axis)
    moved, moving = directions @ give, directions @ rate
    if link.joint == "prismatic":
        return frame.moved(moved, moving)
    for about, angle, angle_rate in zip((Z, Y, X), *split_rotation(moved, moving), strict=True):
        frame = frame.turned(about, angle, angle_rate)
    return frame
