"""The symbolic wing: equations of motion of chains with rigid and flexible links.

The builder and the manipulator are loaded when they are first used: a scene only needs to know the effects.
"""

from typing import TYPE_CHECKING

from flexlin.lazy import load_lazily
from flexlin.mechanics.effects import Effect, register_effect

if TYPE_CHECKING:
    from flexlin.mechanics.chain import build_manipulator
    from flexlin.mechanics.manipulator import Manipulator

__all__ = ["Effect", "Manipulator", "build_manipulator", "register_effect"]

__getattr__ = load_lazily(
    __name__,
    {"mechanics.chain": "build_manipulator", "mechanics.manipulator": "Manipulator"},
    within={
        "mechanics.beam.integrals": "Profile shape_integrals",
        "mechanics.beam.ritz": "Ends bending_shapes",
        "mechanics.link_shapes": "make_shapes sum_carried",
        "mechanics.closed_loop": "close_loop",
        "mechanics.coordinates": "Coordinate Parameters",
        "mechanics.effects": "Chain Scale",
        "mechanics.effects.coulomb_friction": "CoulombFriction",
        "mechanics.body": "directions_across unit",
        "mechanics.closure": "Closure five_bar",
    },
)[0]
