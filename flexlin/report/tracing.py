"""The axes of an arm's links as curves, bent as the arm is."""

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.tracking import arm_positions
from flexlin.mechanics.axes import COLUMNS

STRAIGHT = 1e-9
"""A link whose axis is off a straight line by less, relative to what it sweeps, is drawn as one."""


def trace_arm(lin: Linearization, t: Array, states: Array) -> list[list[Array]]:
    """The axis of each link at each time, (2, k) or (3, k), for deviations (N, n) or (N, 2n) from the rigid motion.

    Each link begins where the one before it ends. Links of a model that does not say how they bend are straight, from joint to joint.
    """
    if lin.arm.axes is None:
        points, _ = arm_positions(lin, t, states)
        return [[at[:, i : i + 2] for i in range(at.shape[1] - 1)] for at in points]
    axes = lin.about.of_arm("axes", t, states[:, : lin.n])
    links = np.split(axes, axes.shape[2] // COLUMNS, axis=2)
    kept = [find_corners(curves) for curves in links]
    return [[curves[k][:, own] for curves, own in zip(links, kept, strict=True)] for k in range(len(t))]


def find_corners(curves: Array) -> list[int]:
    """Which points of a link's axis (N, d, COLUMNS) draw it: both ends of a straight one, all of one that bends, and a piece before it."""
    base, tip = curves[:, :, 1:2], curves[:, :, -1:]
    off = curves[:, :, 1:] - base - (tip - base) * np.linspace(0.0, 1.0, COLUMNS - 1)
    size = max(float(np.ptp(curves)), 1e-300)
    own = [1, COLUMNS - 1] if np.abs(off).max() <= STRAIGHT * size else list(range(1, COLUMNS))
    before = np.abs(curves[:, :, 0] - curves[:, :, 1]).max() > STRAIGHT * size
    return [0, *own] if before else own
