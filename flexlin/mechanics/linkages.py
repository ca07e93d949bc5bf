"""Well-known closed loops, written as screws and joined points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.mechanics.closure import Branch, Closure
from flexlin.mechanics.screws import OpenChain, revolute

Z = (0.0, 0.0, 1.0)


def planar_arm(base: ArrayLike, lengths: ArrayLike) -> tuple[OpenChain, Array]:
    """Return a planar chain of hinges with relative angles, stretched along x at zero, and the position of its tip (3,)."""
    base, lengths = real_array("base", base, (2,)), real_array("lengths", lengths, (None,))
    x = base[0] + np.concatenate([[0.0], np.cumsum(lengths)])
    chain = OpenChain([revolute(Z, (xi, base[1], 0.0)) for xi in x[:-1]])
    return chain, np.array([x[-1], base[1], 0.0])


def five_bar(base: float, left: Sequence[float], right: Sequence[float]) -> Closure:
    """Return a planar 5-bar in s = [q1, q2, q3, q4, x, y]: two arms whose tips are the end effector.

        f = [x - x_a(q1, q2); x - x_b(q3, q4)]

    With u = (x, y) it gives the inverse kinematics, with u = (q1, q3) the forward kinematics.

    Parameters: base: distance of the right arm's hinge from the left one, along x (m); left, right: proximal and distal length (m).
    Source: de Jong et al., Eq (26); angles relative.
    """
    branches = []
    for i, (origin, lengths) in enumerate((((0.0, 0.0), left), ((base, 0.0), right))):
        chain, tip = planar_arm(origin, lengths)
        weight = np.zeros((4, 3))
        weight[2 * i : 2 * i + 2, :2] = -np.eye(2)
        branches.append(Branch(chain, (2 * i, 2 * i + 1), tip, weight))
    linear = np.hstack([np.zeros((4, 4)), np.vstack([np.eye(2), np.eye(2)])])
    return Closure(tuple(branches), linear, np.zeros(4))


def four_bar(base: float, crank: float, coupler: float, rocker: float) -> Closure:
    """Return a planar 4-bar in s = [crank angle, coupler angle relative to the crank, rocker angle]; lengths in m."""
    arm, tip = planar_arm((0.0, 0.0), (crank, coupler))
    other, end = planar_arm((base, 0.0), (rocker,))
    plane = np.eye(2, 3)
    return Closure((Branch(arm, (0, 1), tip, plane), Branch(other, (2,), end, -plane)), np.zeros((2, 3)), np.zeros(2))


def rssr(crank: float, coupler: float, rocker: float, base: ArrayLike, axis: ArrayLike) -> Closure:
    """Return a spatial RSSR loop in s = [crank, two angles of the first ball joint, rocker].

    The crank turns about z through the origin, the rocker about `axis` through `base`; the coupler's spin about itself is left out.

    Parameters: lengths in m; base (3,), axis (3,).
    """
    base = real_array("base", base, (3,))
    ball = (crank, 0.0, 0.0)
    arm = OpenChain([revolute(Z, (0, 0, 0)), revolute(Z, ball), revolute((0, 1, 0), ball)])
    across = np.cross(real_array("axis", axis, (3,)), np.array(Z))
    end = base + rocker * across / np.linalg.norm(across)
    space = np.eye(3)
    branches = (
        Branch(arm, (0, 1, 2), np.array([crank + coupler, 0.0, 0.0]), space),
        Branch(OpenChain([revolute(axis, base)]), (3,), end, -space),
    )
    return Closure(branches, np.zeros((3, 4)), np.zeros(3))
