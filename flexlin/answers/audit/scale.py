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
    """Read the sizes off a scene, stretched out and at rest."""
    arm = build_manipulator(scene)
    M = ca.Function("M", [arm.s], [ca.densify(arm.M)])(np.zeros(arm.n))
    slowest = [
        make_shapes(scene, i, d).beta[0] ** 2 * np.sqrt(link.stiffness_in(d) / (link.mass_per_length * link.length**4))
        for i, link in enumerate(scene.links)
        for d in BENDING
        if getattr(link.counts, d)
    ]
    joints = [float(M[i, i]) for i in range(arm.joints)]
    moving = [i for i, link in enumerate(scene.links) if link.moves]
    return Scale(
        links=scene.links,
        inertias=tuple(joints[moving.index(i)] if i in moving else max(joints) for i in range(len(scene.links))),
        mass=sum(link.mass_per_length * link.length + (link.body.mass if link.body else 0.0) for link in scene.links),
        motion=2 * np.pi / build_motion(scene.motion, arm.joints, arm=arm).period,
        bending=float(min(slowest)) if slowest else None,
    )
