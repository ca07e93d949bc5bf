"""Scenes with loops, and where their joints are by closed forms."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

import flexlin as fl
from flexlin.checks import Array

Z = np.array([0.0, 0.0, 1.0])
ENDS = {"five-bar": [2], "spatial-four-bar": [2], "delta": [2, 7, 12]}
"""Which drawn points of the tree without loops are the ends that loops hold to the last link."""


@dataclass(frozen=True)
class Arms:
    """Bars that turn about fixed axes: bases (k, 3), directions at zero (k, 3), axes (k, 3), lengths (k,)."""

    bases: Array
    along: Array
    axes: Array
    lengths: Array

    def ends(self, q: Array) -> Array:
        """Their ends (k, 3)."""
        turned = Rotation.from_rotvec(self.axes * q[:, None]).apply(self.along)
        return self.bases + self.lengths[:, None] * turned


def rssr_angles(arms: Arms, coupler: float, crank: float) -> Array:
    """Both rocker angles for a crank angle, by |a - b| = l; nan out of reach.

    With b = b0 + r (n cos phi + (e x n) sin phi): A cos phi + B sin phi = C. Source: Hartenberg, Denavit (1964), chapter 12.
    """
    a = arms.ends(np.array([crank, 0.0]))[0]
    n, across, r = arms.along[1], np.cross(arms.axes[1], arms.along[1]), arms.lengths[1]
    d = arms.bases[1] - a
    A, B, C = 2 * r * d @ n, 2 * r * d @ across, coupler**2 - d @ d - r**2
    with np.errstate(invalid="ignore"):
        return np.arctan2(B, A) + np.array([1.0, -1.0]) * np.arccos(C / np.hypot(A, B))


def raw(name, **changes):
    """A shipped scene as plain data."""
    table = fl.load_scene(name).model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True)
    return {**table, **changes}


def random_rssr(rng):
    """A random rigid RSSR as a scene, with its arms in closed form, a crank angle and the rocker's there."""
    rpy = rng.uniform(-3, 3, 3)
    turn = Rotation.from_euler("xyz", rpy)
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    along = np.array([1.0, 0.0, 0.0]) - axis[0] * axis  # the bar need not stand across its axis; here it does
    crank, base = rng.uniform(0.1, 0.3), rng.normal(size=3)
    frame = Rotation.align_vectors([axis, along / np.linalg.norm(along)], [Z, [1.0, 0.0, 0.0]])[0]
    whole = turn * frame
    angle, rocker, start = rng.uniform(-1, 1), rng.uniform(0.4, 0.8), rng.uniform(-3, 3)
    masses = rng.uniform(0.1, 1.0, 3)
    bars = Arms(
        np.array([np.zeros(3), base]),
        np.array([[1.0, 0.0, 0.0], whole.apply([1.0, 0.0, 0.0])]),
        np.array([Z, whole.apply(Z)]),
        np.array([crank, rocker]),
    )
    ends = bars.ends(np.array([angle, start]))
    length = float(np.linalg.norm(ends[1] - ends[0]))
    x, y, z = Rotation.from_rotvec(Z * angle).inv().apply(ends[1] - ends[0]) / length
    mount = {"xyz": base.tolist(), "rpy": whole.as_euler("xyz").tolist()}
    links = [
        {"length": crank, "mass_per_length": masses[0] / crank, "posture": angle},
        {"body": {"mass": 0.0}, "passive": True, "posture": float(np.arctan2(y, x))},
        {"axis": [0.0, -1.0, 0.0], "passive": True, "posture": float(np.arcsin(z)), "name": "coupler"},
        {"parent": "base", "mount": mount, "passive": True, "posture": start, "name": "rocker"},
    ]
    links[2] |= {"length": length, "mass_per_length": masses[2] / length}
    links[3] |= {"length": rocker, "mass_per_length": masses[1] / rocker}
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"mean": angle, "amplitude": 0.1}]}
    effects = {"gravity": {"direction": [0.0, 0.0, -1.0]}}
    loops = [{"link": "coupler", "to": "rocker"}]
    table = {"schema": 1, "title": "RSSR", "links": links, "loops": loops, "effects": effects, "motion": motion}
    return table, bars, length, angle, start


def nearest(angles, to):
    """The angle nearest to another, whole turns apart."""
    shifted = to + (angles - to + np.pi) % (2 * np.pi) - np.pi
    return shifted[np.argmin(np.abs(shifted - to))]


def accelerations(arm, u, u_dot, torque):
    M, B = (np.array(x) for x in ca.Function("f", [arm.s], [arm.M, arm.B])(u))
    rest = np.array(arm.functions["residual"](u, u_dot, np.zeros(arm.n), []))[:, 0]
    return np.linalg.solve(M, B @ torque - rest)
