"""The tables of the effects: an effect is on when its table is present, off when it is not."""

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field, WrapValidator, create_model

from flexlin.scene.base import NonNegative, Number, Positive, Table

PerLink = NonNegative | tuple[NonNegative, ...]
AllPositive = Positive | Annotated[tuple[Positive, ...], Field(min_length=1)]


class Gravity(Table):
    """Gravity in the plane of motion, along -y."""

    acceleration: Number = 9.81


class Payload(Table):
    """A rigid body at the tip of the last link, or one a link; its centre lies `offset` beyond the tip, its inertia is about its centre."""

    mass: PerLink
    inertia: PerLink = 0.0
    offset: Number | tuple[Number, ...] = 0.0


class Hub(Table):
    """A rigid body on each joint; a single number stands for the first joint only."""

    inertia: PerLink = 0.0
    mass: PerLink = 0.0
    radius: PerLink = 0.0


class GeometricStiffening(Table):
    """The shortening of a bent link, kept to second order."""


class ModalDamping(Table):
    """The same damping ratio on every elastic mode, or one ratio a mode of each link."""

    ratio: NonNegative | Annotated[tuple[NonNegative, ...], Field(min_length=1)]


class RotaryInertia(Table):
    """The inertia of the links' sections: radius of gyration sqrt(I/A), one for every link or one a link."""

    radius_of_gyration: PerLink


class Shear(Table):
    """Timoshenko's shear: stiffness kappa G A in N, for every link or one a link."""

    stiffness: AllPositive


class RayleighDamping(Table):
    """alpha M + beta K on the elastic coordinates: alpha in 1/s, beta in s."""

    mass_factor: NonNegative = 0.0
    stiffness_factor: NonNegative = 0.0


class KelvinVoigtDamping(Table):
    """The material's retardation time eta in s, for every link or one a link."""

    retardation_time: PerLink


class JointFlexibility(Table):
    """A spring between each motor and its link, in N m/rad; the motor's inertia on the link side, in kg m^2."""

    stiffness: AllPositive
    motor_inertia: AllPositive


class CoulombFriction(Table):
    """Sliding torque in N m and the rate in rad/s within which it changes sign, for every joint or one a joint."""

    torque: PerLink
    rate: AllPositive = 0.01


class Motor(Table):
    """A direct-current motor behind a gear; the input is then its voltage. SI units, for every joint or one a joint."""

    torque_constant: AllPositive
    resistance: AllPositive
    gear_ratio: AllPositive = 1.0
    rotor_inertia: PerLink = 0.0


class ViscousFriction(Table):
    """A torque -c q' on each joint; a single number stands for every joint."""

    coefficient: Positive | tuple[NonNegative, ...]


class Effects(Table):
    """The effects that a scene calls for."""

    gravity: Gravity | None = None
    payload: Payload | None = None
    hub: Hub | None = None
    geometric_stiffening: GeometricStiffening | None = None
    rotary_inertia: RotaryInertia | None = None
    shear: Shear | None = None
    modal_damping: ModalDamping | None = None
    rayleigh_damping: RayleighDamping | None = None
    kelvin_voigt_damping: KelvinVoigtDamping | None = None
    joint_flexibility: JointFlexibility | None = None
    viscous_friction: ViscousFriction | None = None
    coulomb_friction: CoulombFriction | None = None
    motor: Motor | None = None


_OWN: dict[str, type[Table]] = {}


def add_effect_table(name: str, schema: type[Table]) -> None:
    """Let scenes hold a table [effects.name] of this schema."""
    _OWN[name] = schema


def _with_own_tables(value: Any, handler: Callable[[Any], Effects]) -> Effects:
    """Check the effects against the shipped schemas and those that Python code has added."""
    if not _OWN or isinstance(value, Effects):
        return handler(value)
    fields: dict[str, Any] = {name: (schema | None, None) for name, schema in _OWN.items()}
    return create_model("Effects", __base__=Effects, **fields).model_validate(value)


AnyEffects = Annotated[Effects, WrapValidator(_with_own_tables)]
