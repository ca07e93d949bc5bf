"""The sizes of a scene's arm, from which effects that it leaves out take figures to be tried with."""

import casadi as ca
import numpy as np

from flexlin.mechanics import build_manipulator
from flexlin.mechanics.effects import Scale
from flexlin.mechanics.link_shapes import make_shapes
from flexlin.motion import build_motion
from flexlin.scene.links import Direction
from flexlin.scene.scene import Scene

BENDING: tuple[Direction, ...] = ("y", "z")


def read_scale(scene: Scene) -> Scale:
    """Read the sizes off a scene at rest, stretched out, or with closed loops as they are where the motion begins.

    A joint that follows from loops counts as the lightest that is driven.
    """
    arm = build_manipulator(scene)
    motion = build_motion(scene.motion, arm.joints, arm=arm)
    begun = arm.reference.full() @ motion.sample(np.zeros(1))[0][0] if scene.loops else np.zeros(arm.n)
    M = ca.Function("M", [arm.s], [ca.densify(arm.M)])(begun)
    slowest = [
        make_shapes(scene, i, d).beta[0] ** 2 * np.sqrt(link.stiffness_in(d) / (link.mass_per_length * link.length**4))
        for i, link in enumerate(scene.links)
        for d in BENDING
        if getattr(link.counts, d)
    ]
    joints = [float(M[i, i]) for i in range(arm.joints)]
    driven = [i for i, link in enumerate(scene.links) if link.driven]
    others = [min(joints) if link.passive else max(joints) for link in scene.links]
    return Scale(
        links=scene.links,
        inertias=tuple(joints[driven.index(i)] if i in driven else other for i, other in enumerate(others)),
        mass=sum(link.mass_per_length * link.length + (link.body.mass if link.body else 0.0) for link in scene.links),
        motion=2 * np.pi / motion.period,
        bending=float(min(slowest)) if slowest else None,
    )
