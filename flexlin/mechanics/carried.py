"""What a link carries when the arm is stretched out: the rigid body that loaded shapes are made for."""

from flexlin.mechanics.body import RigidMass
from flexlin.mechanics.effects import effects_of
from flexlin.scene.scene import Scene


def sum_carried(scene: Scene, index: int) -> tuple[float, float]:
    """Mass (kg) of all that lies beyond a link's tip, and its inertia (kg m^2) about that tip.

        m = sum m_k,   J = sum (J_k + m_k d_k^2)

    Assumes the arm rigid and stretched out beyond the tip. Source: De Luca, Siciliano (1991), section IV, at q2 = 0.
    """
    effects, mass, inertia, distance = effects_of(scene.effects), 0.0, 0.0, 0.0
    for body in find_bodies_at_tip(scene, index):
        mass, inertia = mass + body.mass, inertia + body.inertia + body.mass * body.offset**2
    for k in range(index + 1, len(scene.links)):
        link = scene.links[k]
        for body in find_bodies_on_joint(scene, k):
            mass, inertia = mass + body.mass, inertia + body.inertia + body.mass * distance**2
        distance += sum(effect.joint_radius(k) for effect in effects)
        own, centre = link.mass_per_length * link.length, distance + link.length / 2
        mass, inertia = mass + own, inertia + own * (link.length**2 / 12 + centre**2)
        distance += link.length
        for body in find_bodies_at_tip(scene, k):
            mass, inertia = mass + body.mass, inertia + body.inertia + body.mass * (distance + body.offset) ** 2
    return mass, inertia


def find_bodies_on_joint(scene: Scene, index: int) -> list[RigidMass]:
    """The rigid bodies that effects put on a joint."""
    return [body for effect in effects_of(scene.effects) if (body := effect.joint_body(index)) is not None]


def find_bodies_at_tip(scene: Scene, index: int) -> list[RigidMass]:
    """The rigid bodies that effects put on a link's tip."""
    links = len(scene.links)
    return [body for effect in effects_of(scene.effects) if (body := effect.tip_body(index, links)) is not None]
