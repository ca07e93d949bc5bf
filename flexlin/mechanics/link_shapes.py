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
)
from flexlin.mechanics.carried import find_bodies_on_joint, sum_carried
from flexlin.mechanics.effects import effects_of
from flexlin.mechanics.links import Basis
from flexlin.scene.links import Link
from flexlin.scene.scene import Scene


def choose_basis(scene: Scene, index: int) -> Basis:
    """Return the integrals of the shapes that the table of a link asks for: numbers, computed before any graph is built.

    Loaded, hub and sheared shapes take the scene's numbers as they are, and keep them when a mass is left free as a symbol
    (the basis then is no longer exact, but remains a basis).
    """
    shapes, section = make_shapes(scene, index), make_section(scene, index)
    integrals = shape_integrals(shapes, *make_profiles(scene.links[index]))
    stiffness = np.diag(integrals.bending) + (section.shear or 0.0) * np.diag(integrals.shear)
    return Basis(integrals, shapes.beta, stiffness)


def make_shapes(scene: Scene, index: int) -> Shapes:
    """Return the shapes themselves."""
    link, section = scene.links[index], make_section(scene, index)
    ends, base = read_ends(scene, index), "pinned" if link.pinned else "clamped"
    if link.mode_shapes == "finite-element":
        return finite_elements(link.modes, link.elements, *make_profiles(link), ends)
    if link.sections is not None or section.shear is not None:
        return tapered(link.modes, *make_profiles(link), ends, base, section)
    if link.pinned:
        return pinned_with_hub(link.modes, ends.hub_inertia)
    if link.mode_shapes == "clamped-loaded":
        return clamped_with_tip(link.modes, ends.mass, ends.inertia)
    return clamped_free(link.modes)


def make_section(scene: Scene, index: int) -> Section:
    """The height of a link's sections, relative to its length and bending stiffness, where the scene lets them shear."""
    link, effects = scene.links[index], effects_of(scene.effects)
    sheared = [stiffness for effect in effects if (stiffness := effect.section_shear(index)) is not None]
    if not sheared or not link.modes:
        return Section()
    gyration = sum(effect.section_gyration(index) for effect in effects) / link.length
    return Section(sheared[-1] * link.length**2 / link.bending_stiffness, gyration)


def make_profiles(link: Link) -> tuple[Profile | None, Profile | None]:
    """Relative mass and stiffness along the link; None where uniform."""
    if link.sections is None:
        return None, None
    table = link.sections
    return Profile.table(table.at, table.mass), Profile.table(table.at, table.stiffness)


def read_ends(scene: Scene, index: int) -> Ends:
    """The bodies on the link's ends, relative to its own mass, that its shapes are made for."""
    link = scene.links[index]
    if not link.modes:
        return Ends()
    mass = link.mass_per_length * link.length
    if link.mode_shapes == "clamped-loaded":
        carried = sum_carried(scene, index) if link.carried is None else (link.carried.mass, link.carried.inertia)
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
