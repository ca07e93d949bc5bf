"""Paths of the tip as expressions of the phase: position and orientation, with the breaks."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from flexlin.expressions import Expressions
from flexlin.mechanics.frames import rotation_about
from flexlin.motion.waypoints import make_step
from flexlin.scene.tip_path import AnyPath, Circle, Polyline

SAME = 1e-9
"""Breaks that are nearer, as phases, are one."""


@dataclass(frozen=True, eq=False)
class PosePath(Expressions):
    """A closed path: position (3, 1) in m and rotation (3, 3), None where it is free, of the phase; period in s; breaks as phases."""

    phase: ca.SX
    position: ca.SX
    rotation: ca.SX | None
    period: float
    breaks: tuple[float, ...] = ()


def make_pose_path(table: AnyPath) -> PosePath:
    """The path that a table describes."""
    return make_circle(table) if isinstance(table, Circle) else make_polyline(table)


def make_circle(table: Circle) -> PosePath:
    """x = c + r (e_1 cos(2 pi phase) + e_2 sin(2 pi phase)) with e_1, e_2 across the normal, e_1 as near to x as can be."""
    phase = ca.SX.sym("phase")
    normal = np.array(table.normal) / np.linalg.norm(table.normal)
    near = np.eye(3)[0] if abs(normal[0]) < 0.9 else np.eye(3)[1]
    first = near - normal @ near * normal
    first /= np.linalg.norm(first)
    turn = 2 * ca.pi * phase
    across = ca.DM(first) * ca.cos(turn) + ca.DM(np.cross(normal, first)) * ca.sin(turn)
    rotation = None if table.rpy is None else ca.SX(Rotation.from_euler("xyz", table.rpy).as_matrix())
    return PosePath(phase, ca.DM(table.centre) + table.radius * across, rotation, table.period)


def make_polyline(table: Polyline) -> PosePath:
    """x = p_0 + sum_i (p_(i+1) - p_i) a_i,   R = R_0 prod_i exp(a_i w_i~),   w_i = log(R_i^T R_(i+1)).

    a_i goes from 0 to 1 in move_time, one stage of move, dwell and blend time after the one before. The last move may reach into the
    next period, of which it is the first move too.
    """
    phase, count = ca.SX.sym("phase"), len(table.points)
    stage = table.move_time + table.dwell_time - table.blend_time
    period = count * stage
    starts = [-stage, *(i * stage for i in range(count))]
    rises = [make_step(table.profile, ca.fmin(ca.fmax((phase * period - t) / table.move_time, 0), 1)) for t in starts]
    rises[0] = rises[0] - 1
    points = np.array(table.points)
    moves = np.roll(points, -1, axis=0) - points
    position = ca.DM(points[0]) + sum((ca.DM(moves[i - 1]) * rise for i, rise in enumerate(rises)), ca.SX(3, 1))
    ends = sorted({t + extra for t in starts for extra in (0.0, table.move_time)})
    breaks = [t / period for t in ends if -SAME * period < t < period * (1 - SAME)]
    breaks = [max(at, 0.0) for k, at in enumerate(breaks) if k == 0 or at - breaks[k - 1] > SAME]
    rotation = turn_between(table.rpy, rises) if table.rpy else None
    return PosePath(phase, position, rotation, period, tuple(breaks))


def turn_between(rpy: Sequence[tuple[float, float, float]], rises: list[ca.SX]) -> ca.SX:
    """The rotation that goes from one orientation to the next as each rise goes from 0 to 1; the first rise is the last move's end."""
    turns = Rotation.from_euler("xyz", np.array(rpy))
    if len(turns) == 1:
        return ca.SX(turns[0].as_matrix())
    steps = [(turns[i].inv() * turns[(i + 1) % len(turns)]).as_rotvec() for i in range(len(turns))]
    rotation = ca.SX(turns[0].as_matrix())
    for i, rise in enumerate(rises):
        step = steps[i - 1]
        size = float(np.linalg.norm(step))
        if size > 0:
            rotation = rotation @ rotation_about(ca.SX(ca.DM(step / size)), size * rise)
    return rotation
