"""What a link carries when the arm is stretched out: the rigid body that loaded shapes are made for."""

from flexlin.mechanics.effects.base import at_tip, per_joint
from flexlin.scene.scene import Scene


def carried_by(scene: Scene, index: int) -> tuple[float, float]:
    """Mass (kg) of all that lies beyond a link's tip, and its inertia (kg m^2) about that tip.

        m = sum m_k,   J = sum (J_k + m_k d_k^2)

    Assumes the arm rigid and stretched out beyond the tip. Source: De Luca, Siciliano (1991), section IV, at q2 = 0.
    """
    mass, inertia, offset = _payload(scene, index)
    inertia, distance = inertia + mass * offset**2, 0.0
    for k in range(index + 1, len(scene.links)):
        link, hub = scene.links[k], scene.effects.hub
        hub_mass = per_joint(hub.mass, k, single="first") if hub else 0.0
        mass, inertia = mass + hub_mass, inertia + hub_inertia(scene, k) + hub_mass * distance**2
        distance += per_joint(hub.radius, k, single="first") if hub else 0.0
        own, centre = link.mass_per_length * link.length, distance + link.length / 2
        mass, inertia = mass + own, inertia + own * (link.length**2 / 12 + centre**2)
        distance += link.length
        load, load_inertia, offset = _payload(scene, k)
        mass, inertia = mass + load, inertia + load_inertia + load * (distance + offset) ** 2
    return mass, inertia


def hub_inertia(scene: Scene, index: int) -> float:
    """The inertia of the hub on a joint, in kg m^2."""
    hub = scene.effects.hub
    return float(per_joint(hub.inertia, index, single="first")) if hub else 0.0


def _payload(scene: Scene, index: int) -> tuple[float, float, float]:
    """Mass of the body on a link's tip, inertia about its centre, and its offset from the tip."""
    table, links = scene.effects.payload, len(scene.links)
    if table is None:
        return 0.0, 0.0, 0.0
    mass, inertia, offset = (at_tip(value, index, links) for value in (table.mass, table.inertia, table.offset))
    return mass, inertia, offset
