"""Which assumed modes a link has: from its table, and from the bodies that its ends carry."""

from flexlin.errors import ArgumentError
from flexlin.mechanics.beam import (
    Ends,
    Profile,
    Shapes,
    clamped_free,
    clamped_with_tip,
    finite_elements,
    pinned_with_hub,
    tapered,
)
from flexlin.mechanics.carried import carried_by, hub_inertia
from flexlin.scene.links import Link
from flexlin.scene.scene import Scene


def shapes_of(scene: Scene, index: int) -> Shapes:
    """Return the shapes that the table of a link asks for.

    Loaded and hub shapes take the bodies of the scene as they are; shapes are numbers, so they keep those bodies when a mass is left
    free as a symbol (the basis then is no longer exact, but remains a basis).
    """
    link = scene.links[index]
    ends, base = ends_of(scene, index), "pinned" if link.pinned else "clamped"
    if link.mode_shapes == "finite-element":
        return finite_elements(link.modes, link.elements, *profiles(link), ends)
    if link.sections is not None:
        return tapered(link.modes, *profiles(link), ends, base)
    if link.pinned:
        return pinned_with_hub(link.modes, ends.hub_inertia)
    if link.mode_shapes == "clamped-loaded":
        return clamped_with_tip(link.modes, ends.mass, ends.inertia)
    return clamped_free(link.modes)


def profiles(link: Link) -> tuple[Profile | None, Profile | None]:
    """Relative mass and stiffness along the link; None where uniform."""
    if link.sections is None:
        return None, None
    table = link.sections
    return Profile.table(table.at, table.mass), Profile.table(table.at, table.stiffness)


def ends_of(scene: Scene, index: int) -> Ends:
    """The bodies on the link's ends, relative to its own mass, that its shapes are made for."""
    link = scene.links[index]
    if not link.modes:
        return Ends()
    mass = link.mass_per_length * link.length
    if link.mode_shapes == "clamped-loaded":
        carried = carried_by(scene, index) if link.carried is None else (link.carried.mass, link.carried.inertia)
        return Ends(mass=carried[0] / mass, inertia=carried[1] / (mass * link.length**2))
    if link.mode_shapes == "pinned-hub":
        inertia = hub_inertia(scene, index)
        if not inertia:
            raise ArgumentError(
                f"links.{index} has pinned-hub shapes but no hub",
                got="no inertia in effects.hub",
                todo="give effects.hub.inertia, or ask for pinned-free shapes",
            )
        return Ends(hub_inertia=inertia / (mass * link.length**2))
    return Ends()
