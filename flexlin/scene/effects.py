"""The tables of the effects: an effect is on when its table is present, off when it is not."""

from flexlin.scene.base import NonNegative, Number, Positive, Table


class Gravity(Table):
    """Gravity in the plane of motion, along -y."""

    acceleration: Number = 9.81


class Payload(Table):
    """A rigid body at the tip of the last link."""

    mass: NonNegative
    inertia: NonNegative = 0.0


class Hub(Table):
    """A rigid body on each joint; a single number stands for the first joint only."""

    inertia: NonNegative | tuple[NonNegative, ...] = 0.0
    mass: NonNegative | tuple[NonNegative, ...] = 0.0
    radius: NonNegative | tuple[NonNegative, ...] = 0.0


class GeometricStiffening(Table):
    """The shortening of a bent link, kept to second order."""


class ModalDamping(Table):
    """The same damping ratio on every elastic mode, or one ratio a mode of each link."""

    ratio: NonNegative | tuple[NonNegative, ...]


class ViscousFriction(Table):
    """A torque -c q' on each joint; a single number stands for every joint."""

    coefficient: Positive | tuple[NonNegative, ...]


class Effects(Table):
    """The effects that a scene calls for."""

    gravity: Gravity | None = None
    payload: Payload | None = None
    hub: Hub | None = None
    geometric_stiffening: GeometricStiffening | None = None
    modal_damping: ModalDamping | None = None
    viscous_friction: ViscousFriction | None = None
