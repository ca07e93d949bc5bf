"""One file an effect; a scene's table switches it on."""

from flexlin.mechanics.effects.base import Effect
from flexlin.mechanics.effects.geometric_stiffening import GeometricStiffening
from flexlin.mechanics.effects.gravity import Gravity
from flexlin.mechanics.effects.hub import Hub
from flexlin.mechanics.effects.modal_damping import ModalDamping
from flexlin.mechanics.effects.payload import Payload
from flexlin.mechanics.effects.viscous_friction import ViscousFriction
from flexlin.scene.effects import Effects

EFFECTS: dict[str, type[Effect]] = {
    "gravity": Gravity,
    "payload": Payload,
    "hub": Hub,
    "geometric_stiffening": GeometricStiffening,
    "modal_damping": ModalDamping,
    "viscous_friction": ViscousFriction,
}


def effects_of(tables: Effects) -> tuple[Effect, ...]:
    """The effects that a scene calls for."""
    return tuple(effect(getattr(tables, name)) for name, effect in EFFECTS.items() if getattr(tables, name) is not None)


__all__ = ["EFFECTS", "Effect", "effects_of"]
