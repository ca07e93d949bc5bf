"""Point-to-point motions: rest at each waypoint, a smooth polynomial between."""

from functools import reduce

import casadi as ca

from flexlin.errors import MotionError
from flexlin.scene.motion import PointToPoint

PROFILES = {
    "quintic": (0, 0, 0, 10, -15, 6),
    "septic": (0, 0, 0, 0, 35, -84, 70, -20),
}
"""Steps from 0 to 1 with zero rate and acceleration (and jerk) at both ends. Source: Biagiotti, Melchiorri (2008), 2.1."""


def make_point_to_point(table: PointToPoint, phase: ca.SX) -> tuple[ca.SX, ca.SX, tuple[float, ...]]:
    """q = q_i + (q_(i+1) - q_i) step((t - t_i)/move_time), then rest for dwell_time, from waypoint to waypoint.

    Returns: angles (joints, 1), duration, and the breaks as phases. Raises: MotionError when joints have unequal numbers of waypoints.
    """
    counts = [len(joint.waypoints) for joint in table.joints]
    if len(set(counts)) != 1:
        raise MotionError(
            "the joints have unequal numbers of waypoints", got=counts, expected="one angle for each waypoint and joint"
        )
    visits = list(range(counts[0]))
    if table.course == "there-and-back":
        visits += visits[-2::-1]
    moves = len(visits) - 1
    stage = table.move_time + table.dwell_time
    share = table.move_time / stage
    steps = [make_step(table.profile, ca.fmin(ca.fmax((phase * moves - i) / share, 0), 1)) for i in range(moves)]
    angles = []
    for joint in table.joints:
        stops = [joint.waypoints[visit] for visit in visits]
        angles.append(stops[0] + sum((b - a) * rise for a, b, rise in zip(stops, stops[1:], steps, strict=False)))
    breaks = sorted({edge for i in range(moves) for edge in (i / moves, (i + share) / moves) if edge < 1})
    return ca.vertcat(*angles), ca.SX(moves * stage), tuple(breaks)


def make_step(profile: str, x: ca.SX) -> ca.SX:
    """The polynomial step of a profile at x in [0, 1], by Horner's rule."""
    return reduce(lambda value, coefficient: value * x + coefficient, reversed(PROFILES[profile]), ca.SX(0))
