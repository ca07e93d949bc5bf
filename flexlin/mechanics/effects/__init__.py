"""The effects that are shipped, by the tables of a scene that switch them on. Importing this package registers them."""

from flexlin.errors import ArgumentError
from flexlin.mechanics.effects.base import Chain, Effect, Scale
from flexlin.mechanics.effects.bodies import Hub, Payload
from flexlin.mechanics.effects.damping import KelvinVoigtDamping, ModalDamping, RayleighDamping
from flexlin.mechanics.effects.friction import CoulombFriction, ViscousFriction
from flexlin.mechanics.effects.joints import BearingCompliance, JointFlexibility
from flexlin.mechanics.effects.loads import Gravity, TipForce
from flexlin.mechanics.effects.motors import Motor, RotorSpin
from flexlin.mechanics.effects.second_order import BendingTorsionCoupling, GeometricStiffening
from flexlin.mechanics.effects.sections import RotaryInertia, Shear
from flexlin.scene.effects import Effects, add_effect, known_effects

SHIPPED: dict[str, type[Effect]] = {
    "gravity": Gravity,
    "payload": Payload,
    "hub": Hub,
    "geometric_stiffening": GeometricStiffening,
    "bending_torsion_coupling": BendingTorsionCoupling,
    "rotary_inertia": RotaryInertia,
    "shear": Shear,
    "modal_damping": ModalDamping,
    "rayleigh_damping": RayleighDamping,
    "kelvin_voigt_damping": KelvinVoigtDamping,
    "joint_flexibility": JointFlexibility,
    "bearing_compliance": BearingCompliance,
    "viscous_friction": ViscousFriction,
    "coulomb_friction": CoulombFriction,
    "motor": Motor,
    "rotor_spin": RotorSpin,
    "tip_force": TipForce,
}
"""Each effect by its table in a scene, in the order of reports."""


def effects_of(tables: Effects) -> tuple[Effect, ...]:
    """The effects that a scene calls for."""
    return tuple(effect for effect in tables.on().values() if isinstance(effect, Effect))


def register_effect(name: str, effect: type[Effect]) -> None:
    """Let scenes say [effects.name] for an effect that is written in Python.

    Parameters
    ----------
    name : str
        Name of the table; an identifier that is not yet in use.
    effect : type of Effect
        The class: its fields are the keys of the table, its methods what the effect adds to the chain.

    Raises
    ------
    ArgumentError
        When the name is taken or the class is no `Effect`.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.mechanics import Effect, register_effect
    >>> class SpringToWall(Effect):
    ...     "A spring between the tip and where it stands at rest."
    ...     stiffness: float
    ...     def potential_energy(self, chain):
    ...         return self.stiffness * chain.tips[-1].position[1] ** 2 / 2
    >>> register_effect("spring_to_wall", SpringToWall)
    >>> scene = fl.load_scene("single-link", {"effects.spring_to_wall": {"stiffness": 5.0}})
    >>> list(scene.effects.on())[-1]
    'spring_to_wall'
    """
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise ArgumentError("this is no effect", got=repr(effect), expected="a subclass of flexlin.mechanics.Effect")
    if name in known_effects() or hasattr(Effects, name) or not name.isidentifier():
        raise ArgumentError("an effect cannot bear this name", got=repr(name), expected="an identifier not yet in use")
    add_effect(name, effect)


for _name, _effect in SHIPPED.items():
    add_effect(_name, _effect)

__all__ = ["Chain", "Effect", "Effects", "Scale", "effects_of", "register_effect"]
