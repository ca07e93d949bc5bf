"""One file an effect; a scene's table switches it on."""

from flexlin.errors import ArgumentError
from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.effects.coulomb_friction import CoulombFriction
from flexlin.mechanics.effects.geometric_stiffening import GeometricStiffening
from flexlin.mechanics.effects.gravity import Gravity
from flexlin.mechanics.effects.hub import Hub
from flexlin.mechanics.effects.joint_flexibility import JointFlexibility
from flexlin.mechanics.effects.kelvin_voigt_damping import KelvinVoigtDamping
from flexlin.mechanics.effects.modal_damping import ModalDamping
from flexlin.mechanics.effects.motor import Motor
from flexlin.mechanics.effects.payload import Payload
from flexlin.mechanics.effects.rayleigh_damping import RayleighDamping
from flexlin.mechanics.effects.rotary_inertia import RotaryInertia
from flexlin.mechanics.effects.shear import Shear
from flexlin.mechanics.effects.viscous_friction import ViscousFriction
from flexlin.scene.base import Table
from flexlin.scene.effects import Effects, add_effect_table

EFFECTS: dict[str, type[Effect]] = {
    "gravity": Gravity,
    "payload": Payload,
    "hub": Hub,
    "geometric_stiffening": GeometricStiffening,
    "rotary_inertia": RotaryInertia,
    "shear": Shear,
    "modal_damping": ModalDamping,
    "rayleigh_damping": RayleighDamping,
    "kelvin_voigt_damping": KelvinVoigtDamping,
    "joint_flexibility": JointFlexibility,
    "viscous_friction": ViscousFriction,
    "coulomb_friction": CoulombFriction,
    "motor": Motor,
}


def effects_of(tables: Effects) -> tuple[Effect, ...]:
    """The effects that a scene calls for."""
    on = {name: table for name in EFFECTS if (table := getattr(tables, name, None)) is not None}
    return tuple(EFFECTS[name](table) for name, table in on.items())


def register_effect(name: str, schema: type[Table], effect: type[Effect]) -> None:
    """Let scenes say [effects.name] for an effect written in Python: `schema` checks its table, `effect` is built from the table.

    Raises: ArgumentError when the name is taken or the classes do not derive from `Table` and `Effect`.
    """
    if not (issubclass(schema, Table) and issubclass(effect, Effect)):
        raise ArgumentError(
            "an effect needs a schema and an Effect", got=(schema, effect), expected="subclasses of Table and of Effect"
        )
    if name in EFFECTS or not name.isidentifier():
        raise ArgumentError("an effect cannot bear this name", got=repr(name), expected="an identifier not yet in use")
    add_effect_table(name, schema)
    EFFECTS[name] = effect


__all__ = ["EFFECTS", "Chain", "Effect", "effects_of", "register_effect"]
