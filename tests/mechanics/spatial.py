"""Random rigid chains in space."""

from typing import Any

import numpy as np

from flexlin.checks import Array

GRAVITY = np.array([1.3, -4.2, -8.5])


def random_inertia(rng: np.random.Generator, mass: float) -> Array:
    """The inertia of a random cloud of points about its centre."""
    points = rng.normal(size=(6, 3)) * rng.uniform(0.02, 0.3, 3)
    points -= points.mean(axis=0)
    return mass / 6 * (np.sum(points**2) * np.eye(3) - points.T @ points)


def table_of(J: Array) -> dict[str, float]:
    """An inertia as a scene's table."""
    names = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
    return {name: float(J[place]) for name, place in names.items()}


def random_chain(rng: np.random.Generator, joints: int, fixed: float = 0.2) -> list[dict[str, Any]]:
    """Raw tables of rigid links: any axes and mounts, coordinate axes and quarter turns among them, some joints fixed."""
    links: list[dict[str, Any]] = []
    while sum(link["joint"] != "fixed" for link in links) < joints:
        mass = float(rng.uniform(0.1, 5.0))
        body = {"mass": mass, "centre": rng.normal(size=3).tolist(), "inertia": table_of(random_inertia(rng, mass))}
        axis = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
        rpy = rng.uniform(-3, 3, 3) if rng.random() < 0.5 else rng.integers(-2, 3, 3) * np.pi / 2
        kind = "fixed" if rng.random() < fixed else str(rng.choice(["revolute", "revolute", "prismatic"]))
        link = {"joint": kind, "body": body, "mount": {"xyz": rng.normal(size=3).tolist(), "rpy": rpy.tolist()}}
        links.append(link if kind == "fixed" else {**link, "axis": axis.tolist()})
    return links


def scene_table(links: list[dict[str, Any]], **effects: Any) -> dict[str, Any]:
    """A raw scene of these links under gravity in any direction."""
    joints = [{"amplitude": 0.1}] * sum(link["joint"] != "fixed" for link in links)
    gravity = {"acceleration": float(np.linalg.norm(GRAVITY)), "direction": GRAVITY.tolist()}
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": joints}
    return {"schema": 1, "title": "chain", "links": links, "effects": {"gravity": gravity, **effects}, "motion": motion}
