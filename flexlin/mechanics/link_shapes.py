"""Which assumed modes a link has: from its table, and from the bodies that its ends carry."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.beam.integrals import UNIFORM, Profile, Shapes, couple_shapes, shape_integrals
from flexlin.mechanics.beam.ritz import Ends, Section, bending_shapes, twisted
from flexlin.mechanics.curve import CurveRule, make_rule
from flexlin.mechanics.effects import effects_of
from flexlin.mechanics.links import PLACES, Basis, LinkBasis
from flexlin.scene.links import DIRECTIONS, Direction, Link, list_parents
from flexlin.scene.scene import Scene

STRAIGHT = bending_shapes(0)
"""The shapes of a link that does not deflect."""


def choose_basis(scene: Scene, index: int) -> LinkBasis:
    """Return the integrals of all shapes that the table of a link asks for: numbers, computed before any graph is built.

    Loaded, hub and sheared shapes take the scene's numbers as they are, and keep them when a mass is left free as a symbol
    (the basis then is no longer exact, but remains a basis).
    """
    link = scene.links[index]
    shapes = [make_shapes(scene, index, one) for one in DIRECTIONS]
    y, z, twist = (integrate_basis(scene, index, part, one) for part, one in zip(shapes, DIRECTIONS, strict=True))
    if sum(part.n > 0 for part in shapes) < 2:
        return LinkBasis(y, z, twist)
    return LinkBasis(y, z, twist, couple_shapes(shapes[0], shapes[1], shapes[2], *make_profiles(link)))


def choose_rule(scene: Scene, index: int) -> CurveRule:
    """Where and how the axis of a link is looked at when it bends far."""
    y, z, twist = (make_shapes(scene, index, part) for part in DIRECTIONS)
    return make_rule(y, z, twist, *make_profiles(scene.links[index]))


def integrate_basis(scene: Scene, index: int, shapes: Shapes, direction: Direction) -> Basis:
    """The integrals of the shapes of one direction."""
    integrals = shape_integrals(shapes, *make_profiles(scene.links[index]))
    shear = make_section(scene, index, direction).shear if direction != "torsion" else None
    stiffness = np.diag(integrals.bending) + (shear or 0.0) * np.diag(integrals.shear)
    return Basis(integrals, shapes.beta, stiffness, shapes.values(PLACES))


def make_shapes(scene: Scene, index: int, direction: Direction = "y") -> Shapes:
    """Return the shapes themselves."""
    link = scene.links[index]
    n = getattr(link.counts, direction)
    if not n:
        return STRAIGHT
    if direction == "torsion":
        return twisted(n, make_profiles(link)[1], read_disc(scene, index))
    ends, section = read_ends(scene, index, direction), make_section(scene, index, direction)
    elements = link.elements if link.mode_shapes == "finite-element" else None
    return bending_shapes(n, *make_profiles(link), ends, link.pinned, section, elements)


def make_section(scene: Scene, index: int, direction: Direction = "y") -> Section:
    """The height of a link's sections, relative to its length and bending stiffness, where the scene lets them shear."""
    link, effects = scene.links[index], effects_of(scene.effects)
    sheared = [stiffness for effect in effects if (stiffness := effect.section_shear(index)) is not None]
    if not sheared or not getattr(link.counts, direction):
        return Section()
    gyration = sum(effect.section_gyration(index) for effect in effects) / link.length
    return Section(sheared[-1] * link.length**2 / link.stiffness_in(direction), gyration)


def make_profiles(link: Link) -> tuple[Profile, Profile]:
    """Relative mass and stiffness along the link."""
    table = link.sections
    if table is None:
        return UNIFORM, UNIFORM
    return Profile.table(table.at, table.mass), Profile.table(table.at, table.stiffness)


def read_disc(scene: Scene, index: int) -> float:
    """What the tip carries, as inertia about the link's axis relative to the link's own, that the shapes of twist are made for."""
    link = scene.links[index]
    if link.mode_shapes != "clamped-loaded" or link.carried is not None or link.polar_inertia is None:
        return 0.0
    return sum_carried(scene, index, "torsion")[1] / (link.polar_inertia * link.length)


def read_ends(scene: Scene, index: int, direction: Direction = "y") -> Ends:
    """The bodies on the link's ends, relative to its own mass, that its shapes are made for."""
    link = scene.links[index]
    mass = link.mass_per_length * link.length
    if link.mode_shapes == "clamped-loaded":
        carried = (
            sum_carried(scene, index, direction) if link.carried is None else (link.carried.mass, link.carried.inertia)
        )
        return Ends(mass=carried[0] / mass, inertia=carried[1] / (mass * link.length**2))
    if link.mode_shapes == "pinned-hub":
        hubs = [effect.joint_body(index) for effect in effects_of(scene.effects)]
        inertia = float(sum(body.inertia for body in hubs if body is not None))
        if not inertia:
            raise ArgumentError(
                f"links.{index} has pinned-hub shapes but no hub",
                got="no inertia in effects.hub",
                todo="give effects.hub.inertia, or ask for pinned-free shapes",
            )
        return Ends(hub_inertia=inertia / (mass * link.length**2))
    return Ends()


AXES = {direction: axis for axis, direction in enumerate(reversed(DIRECTIONS))}
"""The axis about which the tip turns when the link deflects."""


def sum_carried(scene: Scene, index: int, direction: Direction = "y") -> tuple[float, float]:
    """Mass (kg) of all that lies beyond a link's tip, and its inertia (kg m^2) about the axis of the tip that the deflection turns.

        m = sum m_k,   J = sum R_k J_k R_k^T + m_k (d.d E - d d^T)

    Assumes the arm rigid beyond the tip, with all joints at zero and without mounts' angles about z: stretched out.
    Source: De Luca, Siciliano (1991), section IV, at q2 = 0.
    """
    from flexlin.scene.urdf.convert import Mass, rotation_of

    effects, load, parents = effects_of(scene.effects), Mass(), list_parents(scene.links)
    tips = {index: (np.eye(3), np.zeros(3))}
    for k in range(index + 1, len(scene.links)):
        if parents[k] not in tips:
            continue
        link, (R, p) = scene.links[k], tips[parents[k]]
        p, R = p + R @ np.array(link.mount.xyz), R @ rotation_of(link.mount.rpy)
        axis = np.array(link.joint_axis) / np.linalg.norm(link.joint_axis)
        for body in (effect.joint_body(k) for effect in effects):
            if body is not None:
                load.add(body.mass, body.inertia * np.outer(axis, axis), R, p)
        p = p + R[:, 0] * sum(effect.joint_radius(k) for effect in effects)
        for mass, inertia, centre in list_parts(link):
            load.add(mass, inertia, R, p + R @ centre)
        p = p + R[:, 0] * link.length
        tips[k] = (R, p)
    for k, (R, p) in tips.items():
        for body in (effect.tip_body(k, len(scene.links)) for effect in effects):
            if body is not None:
                J = np.array(body.tensor.rows()) + body.inertia * np.diag([0.0, 0.0, 1.0])
                load.add(body.mass, J, R, p + R @ np.array(body.place))
    about = AXES[direction]
    return load.mass, float(load.second[about, about])


def list_parts(link: Link) -> list[tuple[float, Array, Array]]:
    """A link as rigid bodies, each with its mass, inertia about its centre, and centre."""
    own = link.mass_per_length * link.length
    polar = (link.polar_inertia or 0.0) * link.length
    rod = np.diag([polar, own * link.length**2 / 12, own * link.length**2 / 12])
    parts = [(own, rod, np.array([link.length / 2, 0.0, 0.0]))]
    if link.body is not None:
        parts.append((link.body.mass, np.array(link.body.inertia.rows()), np.array(link.body.centre)))
    return parts
