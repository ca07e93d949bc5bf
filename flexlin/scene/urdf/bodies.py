"""Rotations by roll, pitch and yaw, and rigid bodies that are added up."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexlin.scene.urdf.robot import POINT, UrdfLink

Array = NDArray[np.float64]
ENTRIES = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
ROUNDING = 1e-15


@dataclass
class Mass:
    """A rigid body that others are added to: mass, first moment and inertia about the origin."""

    mass: float = 0.0
    first: Array = field(default_factory=lambda: np.zeros(3))
    second: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def add(self, link: UrdfLink, rotation: Array, place: Array) -> None:
        """Add a link whose frame lies at `place`, turned by `rotation`."""
        turn = rotation @ rotation_of(link.rpy)
        c = place + rotation @ np.array(link.centre)
        own = np.zeros((3, 3))
        for key, (i, j) in ENTRIES.items():
            own[i, j] = own[j, i] = link.inertia.get(key, 0.0)
        self.mass += link.mass
        self.first = self.first + link.mass * c
        self.second = self.second + turn @ own @ turn.T + link.mass * (c @ c * np.eye(3) - np.outer(c, c))

    def table(self) -> dict[str, Any]:
        """The body as a table of a scene's link."""
        c = self.first / self.mass if self.mass else np.zeros(3)
        J = self.second - self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        size = np.abs(self.second).max() + POINT / ROUNDING * self.mass
        inertia = {key: tidy(J[place], size) for key, place in ENTRIES.items()}
        inertia |= {key: max(inertia[key], 0.0) for key in ("xx", "yy", "zz")}
        return {"mass": self.mass, "centre": as_numbers(c), "inertia": inertia}


def tidy(value: float, size: float) -> float:
    """A number, or zero where it is rounding of numbers of some size."""
    return float(value) if abs(value) > 10 * ROUNDING * size else 0.0


def rotation_of(rpy: tuple[float, ...]) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), with zeros for what is only rounding of quarter turns."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    R = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return np.where(np.abs(R) < ROUNDING, 0.0, R)


def angles_of(R: Array) -> list[float]:
    """Roll, pitch and yaw of a rotation; the roll undoes what the yaw says, so that a pitch near a quarter turn loses nothing."""
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    yaw = float(np.arctan2(R[1, 0], R[0, 0])) if flat > ROUNDING else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    roll = float(np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1]))
    return as_numbers((roll, float(np.arctan2(-R[2, 0], flat)), yaw))


def as_numbers(values: Iterable[float]) -> list[float]:
    """Numbers as a list, with 0 for minus 0."""
    return [float(value) + 0.0 for value in values]
