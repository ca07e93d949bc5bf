"""What a link carries when the arm is stretched out: the rigid body that loaded shapes are made for."""

from dataclasses import dataclass, field

import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.body import RigidMass
from flexlin.mechanics.effects import effects_of
from flexlin.scene.links import Direction, Link, list_parents
from flexlin.scene.scene import Scene
from flexlin.scene.space import Inertia

AXES: dict[Direction, int] = {"torsion": 0, "z": 1, "y": 2}
"""The axis about which the tip turns when the link deflects."""


@dataclass
class Load:
    """Mass (kg) and inertia about a link's tip (3, 3) of bodies that are added one by one, in the tip's axes."""

    mass: float = 0.0
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def add(self, mass: float, inertia: Array, rotation: Array, centre: Array) -> None:
        """Add a body with its inertia about its centre in axes of its own."""
        shifted = np.dot(centre, centre) * np.eye(3) - np.outer(centre, centre)
        self.mass += mass
        self.inertia = self.inertia + rotation @ inertia @ rotation.T + mass * shifted


def sum_carried(scene: Scene, index: int, direction: Direction = "y") -> tuple[float, float]:
    """Mass (kg) of all that lies beyond a link's tip, and its inertia (kg m^2) about the axis of the tip that the deflection turns.

        m = sum m_k,   J = sum R_k J_k R_k^T + m_k (d.d E - d d^T)

    Assumes the arm rigid beyond the tip, with all joints at zero and without mounts' angles about z: stretched out.
    Source: De Luca, Siciliano (1991), section IV, at q2 = 0.
    """
    effects, load, parents = effects_of(scene.effects), Load(), list_parents(scene.links)
    tips = {index: (np.eye(3), np.zeros(3))}
    for body in find_bodies_at_tip(scene, index):
        load.add(body.mass, read_tensor(body), np.eye(3), place(body))
    for k in range(index + 1, len(scene.links)):
        if parents[k] not in tips:
            continue
        from flexlin.scene.urdf.bodies import rotation_of

        link, (R, p) = scene.links[k], tips[parents[k]]
        p, R = p + R @ np.array(link.mount.xyz), R @ rotation_of(link.mount.rpy)
        for body in find_bodies_on_joint(scene, k):
            axis = np.array(link.joint_axis) / np.linalg.norm(link.joint_axis)
            load.add(body.mass, body.inertia * np.outer(axis, axis), R, p)
        p = p + R[:, 0] * sum(effect.joint_radius(k) for effect in effects)
        for mass, inertia, centre in list_parts(link):
            load.add(mass, inertia, R, p + R @ centre)
        p = p + R[:, 0] * link.length
        for body in find_bodies_at_tip(scene, k):
            load.add(body.mass, read_tensor(body), R, p + R @ place(body))
        tips[k] = (R, p)
    axis = AXES[direction]
    return load.mass, float(load.inertia[axis, axis])


def list_parts(link: Link) -> list[tuple[float, Array, Array]]:
    """A link as rigid bodies, each with its mass, inertia about its centre, and centre."""
    own = link.mass_per_length * link.length
    polar = (link.polar_inertia or 0.0) * link.length
    rod = np.diag([polar, own * link.length**2 / 12, own * link.length**2 / 12])
    parts = [(own, rod, np.array([link.length / 2, 0.0, 0.0]))]
    if link.body is not None:
        parts.append((link.body.mass, as_matrix(link.body.inertia), np.array(link.body.centre)))
    return parts


def as_matrix(inertia: Inertia) -> Array:
    """An inertia's table as a matrix (3, 3)."""
    xx, yy, zz, xy, xz, yz = inertia.entries().values()
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_tensor(body: RigidMass) -> Array:
    """The inertia (3, 3) of a body on a tip."""
    about_z = np.diag([0.0, 0.0, body.inertia])
    return about_z if body.tensor is None else about_z + as_matrix(body.tensor)


def place(body: RigidMass) -> Array:
    """The centre of a body on a tip."""
    return np.array([body.offset, 0.0, 0.0]) + np.array(body.centre)


def find_bodies_on_joint(scene: Scene, index: int) -> list[RigidMass]:
    """The rigid bodies that effects put on a joint."""
    return [body for effect in effects_of(scene.effects) if (body := effect.joint_body(index)) is not None]


def find_bodies_at_tip(scene: Scene, index: int) -> list[RigidMass]:
    """The rigid bodies that effects put on a link's tip."""
    links = len(scene.links)
    return [body for effect in effects_of(scene.effects) if (body := effect.tip_body(index, links)) is not None]
