"""Basic motions of closed loops: the joints follow when other coordinates, such as a tip's position, are led along a path."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from flexlin.checks import Array
from flexlin.errors import MotionError, counted
from flexlin.motion.base import Angles, Motion, SampledMotion
from flexlin.series.maps import ImplicitMap


def loop_angles(loop: ImplicitMap, path: Motion, joints: Sequence[int], t: Array) -> Angles:
    """q, q', q'' of some dependent coordinates while the independent ones follow a path."""
    q, q1, q2 = (values[:, list(joints)] for values in loop.rates(*path.sample(t)))
    return q, q1, q2


def through_loop(c: ImplicitMap, path: Motion, joints: Sequence[int], prescribed: Sequence[bool] = ()) -> SampledMotion:
    """Return the motion of some dependent coordinates of a closed loop while its independent ones follow a path.

        q = v_joints(u(t)),   q' , q'' from f(u, v) = 0 by a power series in time

    v is the Taylor map's value refined by Newton's method, so it is exact wherever the map is near enough.

    Parameters: c: v(u), about a point near the path; path: any motion, its "joints" being the independent coordinates u;
    joints: which entries of v the manipulator's joints are; prescribed: for each of them, default none.
    Raises: MotionError when numbers do not fit; ToleranceNotReached naming a point where the loop does not close.
    Source: de Jong, Müller, van Dijk, Herder (2018), Eq (25), refined.
    """
    if path.joints != len(c.u0) or not set(joints) <= set(range(len(c.v0))):
        raise MotionError(
            "the path does not fit the loop",
            got=f"{counted(path.joints, 'coordinate')}, joints {list(joints)}",
            expected=f"{counted(len(c.u0), 'coordinate')}, joints below {len(c.v0)}",
        )
    sample = partial(loop_angles, c, path, joints)
    drives = tuple(prescribed) or (False,) * len(joints)
    sample(np.linspace(0, path.period, 33))
    return SampledMotion(len(joints), path.period, drives, path.breaks, path.periodic, sampler=sample)
