"""Viscous joint friction: a torque -c q' on each joint, R = 1/2 sum c q'^2."""

from typing import Annotated

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.effects.scale import LOSS, Scale
from flexlin.mechanics.effects.shared import per_joint
from flexlin.scene.base import NonNegative, Positive, Unit


class ViscousFriction(Effect):
    """A torque -c q' on each joint; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    coefficient: Annotated[Positive | tuple[NonNegative, ...], Unit("N m s/rad")]
    """Torque per rate of each joint."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "ViscousFriction":
        return cls(coefficient=scale.of_inertias(2 * LOSS * scale.motion))

    def dissipation(self, chain: Chain) -> ca.SX:
        coefficients = [per_joint(self.coefficient, i, single="every") for i in chain.moving]
        return ca.dot(ca.vertcat(*coefficients), chain.q_rate**2) / 2
