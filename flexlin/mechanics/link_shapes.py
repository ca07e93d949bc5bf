"""Which assumed modes a link has: from its table, and from the bodies that its ends carry."""

import numpy as np

from flexlin.errors import ArgumentError
from flexlin.mechanics.beam import (
    Ends,
    Profile,
    Section,
    Shapes,
    clamped_free,
    clamped_with_tip,
    finite_elements,
    pinned_with_hub,
    shape_integrals,
    tapered,
    twisted,
)
from flexlin.mechanics.beam.couplings import couple_shapes
from flexlin.mechanics.deflection import PLACES, Basis
from flexlin.mechanics.effects import effects_of
from flexlin.mechanics.links import LinkBasis
from flexlin.scene.links import DIRECTIONS, Direction, Link
from flexlin.scene.scene import Scene

STRAIGHT = clamped_free(0)
"""The shapes of a link that does not deflect."""


def choose_basis(scene: Scene, index: int) -> LinkBasis:
    """Return the integrals of all shapes that the table of a link asks for: numbers, computed before any graph is built.

    Loaded, hub and sheared shapes take the scene's numbers as they are, and keep them when a mass is left free as a symbol
    (the basis then is no longer exact, but remains a basis).
    """
    link = scene.links[index]
    deflected = [direction for direction, modes in link.counts.by_direction().items() if modes]
    shapes = {direction: make_shapes(scene, index, direction) for direction in deflected} or {"y": STRAIGHT}
    found = {direction: integrate_basis(scene, index, part, direction) for direction, part in shapes.items()}
    straight = next(iter(found.values())).without_modes()
    y, z, torsion = (found.get(direction, straight) for direction in DIRECTIONS)
    if len(deflected) < 2:
        return LinkBasis(y, z, torsion)
    bent_y, bent_z, twist = (shapes.get(direction, STRAIGHT) for direction in DIRECTIONS)
    return LinkBasis(y, z, torsion, couple_shapes(bent_y, bent_z, twist, *make_profiles(link)))


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
    if direction == "torsion":
        return twisted(n, make_profiles(link)[1], read_disc(scene, index))
    section = make_section(scene, index, direction)
    ends, base = read_ends(scene, index, direction), "pinned" if link.pinned else "clamped"
    if link.mode_shapes == "finite-element":
        return finite_elements(n, link.elements, *make_profiles(link), ends)
    if link.sections is not None or section.shear is not None:
        return tapered(n, *make_profiles(link), ends, base, section)
    if link.pinned:
        return pinned_with_hub(n, ends.hub_inertia)
    if link.mode_shapes == "clamped-loaded":
        return clamped_with_tip(n, ends.mass, ends.inertia)
    return clamped_free(n)


def make_section(scene: Scene, index: int, direction: Direction = "y") -> Section:
    """The height of a link's sections, relative to its length and bending stiffness, where the scene lets them shear."""
    link, effects = scene.links[index], effects_of(scene.effects)
    sheared = [stiffness for effect in effects if (stiffness := effect.section_shear(index)) is not None]
    if not sheared or not getattr(link.counts, direction):
        return Section()
    gyration = sum(effect.section_gyration(index) for effect in effects) / link.length
    return Section(sheared[-1] * link.length**2 / link.stiffness_in(direction), gyration)


def make_profiles(link: Link) -> tuple[Profile | None, Profile | None]:
    """Relative mass and stiffness along the link; None where uniform."""
    if link.sections is None:
        return None, None
    table = link.sections
    return Profile.table(table.at, table.mass), Profile.table(table.at, table.stiffness)


def read_disc(scene: Scene, index: int) -> float:
    """What the tip carries, as inertia about the link's axis relative to the link's own, that the shapes of twist are made for."""
    link = scene.links[index]
    unloaded = link.mode_shapes != "clamped-loaded" or link.carried is not None
    if unloaded or not link.counts.torsion or link.polar_inertia is None:
        return 0.0
    from flexlin.mechanics.carried import sum_carried

    return sum_carried(scene, index, "torsion")[1] / (link.polar_inertia * link.length)


def read_ends(scene: Scene, index: int, direction: Direction = "y") -> Ends:
    """The bodies on the link's ends, relative to its own mass, that its shapes are made for."""
    link = scene.links[index]
    if not getattr(link.counts, direction):
        return Ends()
    from flexlin.mechanics.carried import find_bodies_on_joint, sum_carried

    mass = link.mass_per_length * link.length
    if link.mode_shapes == "clamped-loaded":
        carried = (
            sum_carried(scene, index, direction) if link.carried is None else (link.carried.mass, link.carried.inertia)
        )
        return Ends(mass=carried[0] / mass, inertia=carried[1] / (mass * link.length**2))
    if link.mode_shapes == "pinned-hub":
        inertia = float(sum(body.inertia for body in find_bodies_on_joint(scene, index)))
        if not inertia:
            raise ArgumentError(
                f"links.{index} has pinned-hub shapes but no hub",
                got="no inertia in effects.hub",
                todo="give effects.hub.inertia, or ask for pinned-free shapes",
            )
        return Ends(hub_inertia=inertia / (mass * link.length**2))
    return Ends()
