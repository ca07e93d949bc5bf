"""Scenes with loops, and what their joints do by closed forms and by multipliers."""

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

import flexlin as fl

from .linkages import Arms

Z = np.array([0.0, 0.0, 1.0])
ENDS = {"five-bar": [2], "spatial-four-bar": [2], "delta": [2, 7, 12]}
"""Which drawn points of the tree without loops are the ends that loops hold to the last link."""


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
        masses[:2],
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
    return table, bars, length, masses[2], angle, start


def nearest(angles, to):
    """The angle nearest to another, whole turns apart."""
    shifted = to + (angles - to + np.pi) % (2 * np.pi) - np.pi
    return shifted[np.argmin(np.abs(shifted - to))]


def accelerations(arm, u, u_dot, torque):
    M, B = (np.array(x) for x in ca.Function("f", [arm.s], [arm.M, arm.B])(u))
    rest = np.array(arm.functions["residual"](u, u_dot, np.zeros(arm.n), []))[:, 0]
    return np.linalg.solve(M, B @ torque - rest)


def delta_arms(table):
    chosen = [link for link in table["links"] if link["name"].endswith("arm")]
    yaws = np.array([link["mount"]["rpy"][2] for link in chosen])
    along = np.stack([np.cos(yaws), np.sin(yaws), 0 * yaws], axis=1)
    bases = np.array([link["mount"]["xyz"] for link in chosen])
    length, density = chosen[0]["length"], chosen[0]["mass_per_length"]
    return Arms(bases, along, np.cross(Z, along), np.full(3, length), np.full(3, length * density))
