"""A planar 5-bar: two arms of two links, hinged together at their tips, a motor at each base joint; links rigid or flexible."""

from dataclasses import replace
from typing import Annotated

import casadi as ca
from pydantic import Field

import flexlin as fl
from flexlin.mechanics import Effect
from flexlin.mechanics.closed_loop import close_loop, side_by_side
from flexlin.mechanics.effects import effects_of
from flexlin.scene import Scene, parse_scene, register_model
from flexlin.scene.base import Number, Positive, Table, Unit
from flexlin.scene.effects import AnyEffects, Effects
from flexlin.scene.links import Link

TwoLinks = Annotated[tuple[Link, ...], Field(min_length=2, max_length=2)]
FourAngles = Annotated[tuple[Number, ...], Field(min_length=4, max_length=4)]


class Parameters(Table):
    """Two arms whose bases lie `base` apart along x; `posture` is near the middle of the motion and chooses both elbows.

    Effects hold for both arms, the payload at the common hinge once. Angles are relative, in rad: base and elbow of the left arm,
    then of the right one.
    """

    base: Annotated[Positive, Unit("m")]
    """Distance of the two base joints."""
    left: TwoLinks
    """The two links of the left arm."""
    right: TwoLinks
    """The two links of the right arm."""
    posture: Annotated[FourAngles, Unit("rad")]
    """Angles near the middle of the motion: base and elbow of the left arm, then of the right one."""
    effects: AnyEffects
    """The physical effects of both arms."""


def build(p: Parameters) -> fl.Manipulator:
    """Close two open arms at their tips.

    Coordinates: u = [q_left; q_right; elastic coordinates of both], motors at the base joints; the elbows depend on u.
    """
    pair, gap, elbows = open_arms(p)
    bases = (0, elbows[1] - 1)
    independent = [*bases, *(i for i in range(pair.n) if i not in {*bases, *elbows})]
    posture = [0.0] * pair.n
    for index, angle in zip((bases[0], elbows[0], bases[1], elbows[1]), p.posture, strict=True):
        posture[index] = angle
    closed = close_loop(pair, gap, independent, motors=(0, 2), posture=posture)
    turns = any(type(effect).features is not Effect.features for effect in effects_of(p.effects))
    return replace(closed, effects=None if turns else p.effects)  # elbows turn at times that the motion does not name


def open_arms(p: Parameters) -> tuple[fl.Manipulator, ca.SX, tuple[int, int]]:
    """Both arms side by side, the gap between their tips f = x_left - x_right (2, 1), and which coordinates are the elbows."""
    left = fl.build_manipulator(arm_scene(p.left, p.effects))
    right = fl.build_manipulator(arm_scene(p.right, p.effects.model_copy(update={"payload": None})))
    points = ca.horzcat(*[point + ca.DM([p.base, 0]) for point in ca.horzsplit(right.points)])
    return (
        side_by_side(left, right, ("left", "right"), points),
        left.points[:, -1] - points[:, -1],
        (1, left.n + 1),
    )


def arm_scene(links: tuple[Link, ...], effects: Effects) -> Scene:
    """One open arm as a scene of its own; its motion is not used."""
    still = {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.0}] * 2}
    tables = effects.model_dump(exclude_none=True, exclude_unset=True)
    return parse_scene(
        {
            "schema": 1,
            "title": "arm",
            "links": [link.model_dump(exclude_unset=True) for link in links],
            "effects": tables,
            "motion": still,
        }
    )


register_model("five-bar", Parameters, build)
