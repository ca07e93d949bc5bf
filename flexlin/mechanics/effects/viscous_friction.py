"""Viscous joint friction: a torque -c q' on each joint, or -c theta' on each motor, R = 1/2 sum c q'^2.

With `exponent` n the torque is -c q' (q'^2 + eps^2)^((n - 1)/2), R = c / (n + 1) (q'^2 + eps^2)^((n + 1)/2): grease thins as it is sheared
(n < 1), beside Coulomb friction Herschel and Bulkley's law. Below eps, `rate`, it is a damper.
Source: Cousseau, Graca, Campos, Seabra, Tribology International 44 (2011) 1885 (grease); Taghirad, Belanger, Modeling and parameter
identification of harmonic drive systems, J. Dynamic Systems, Measurement, and Control 120 (1998) 439.
"""

from typing import Annotated, Literal

import casadi as ca

from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale, per_joint
from flexlin.mechanics.effects.narrow import Features, Moving, slow_passages
from flexlin.scene.base import AllPositive, NonNegative, Positive, Unit


class ViscousFriction(Effect):
    """A torque -c q' on each joint; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    coefficient: Annotated[Positive | tuple[NonNegative, ...], Unit("N m s/rad")]
    """Torque per rate of each joint; at 1 rad/s where an exponent is given."""
    exponent: Annotated[AllPositive | None, Unit("")] = None
    """Power of the rate to which the torque grows, such as 0.5 of grease in a harmonic drive; 1 where none is given."""
    rate: Annotated[AllPositive, Unit("rad/s")] = 0.01
    """Rate below which an exponent no longer counts."""
    at: Literal["joint", "motor"] = "joint"
    """Whether the bearing behind a flexible joint's spring rubs, or the motor before it with its gear."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "ViscousFriction":
        return cls(coefficient=scale.of_inertias(2 * LOSS * scale.motion))

    def features(self, motion: Moving) -> Features:
        """Where a joint turns round, an exponent's slope lasts while |q'| is a few eps."""
        if self.exponent is None:
            return ()
        bent = [i for i in range(motion.joints) if per_joint(self.exponent, i) != 1]
        return tuple(found for i in bent for found in slow_passages(motion, i, per_joint(self.rate, i)))

    def dissipation(self, chain: Chain) -> ca.SX:
        rates = chain.motor_rate if self.at == "motor" else chain.q_rate
        coefficients, powers, slow = (
            ca.vertcat(*[per_joint(value, i) for i in chain.moving])
            for value in (self.coefficient, 1.0 if self.exponent is None else self.exponent, self.rate)
        )
        if self.exponent is None:
            return ca.dot(coefficients, rates**2) / 2
        return ca.dot(coefficients / (powers + 1), (rates**2 + slow**2) ** ((powers + 1) / 2))
