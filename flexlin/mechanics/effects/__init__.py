"""One file an effect; a scene's table switches it on. Importing this package registers the shipped effects."""

from importlib import import_module

from flexlin.errors import ArgumentError
from flexlin.mechanics.effects.base import Chain, Effect, Scale, effects_of
from flexlin.scene.effects import Effects, add_effect, known_effects

SHIPPED = (
    "gravity",
    "payload",
    "hub",
    "geometric_stiffening",
    "bending_torsion_coupling",
    "rotary_inertia",
    "shear",
    "modal_damping",
    "rayleigh_damping",
    "kelvin_voigt_damping",
    "joint_flexibility",
    "bearing_compliance",
    "viscous_friction",
    "coulomb_friction",
    "motor",
    "rotor_spin",
    "tip_force",
)
"""The file, and the scene's table, of each effect, in the order of reports; the class is the same name in capitals."""


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


for _name in SHIPPED:
    add_effect(_name, getattr(import_module(f"{__name__}.{_name}"), _name.title().replace("_", "")))

__all__ = ["Chain", "Effect", "Effects", "Scale", "effects_of", "register_effect"]
