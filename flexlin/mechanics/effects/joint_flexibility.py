"""Joint flexibility: each motor has a coordinate theta of its own behind a spring, V = 1/2 k (theta - q)^2, T = 1/2 J_m theta'^2,
R = 1/2 d (theta' - q')^2.

Assumes the motor's inertia, reflected to the link side, sees its own rate only (gears turn it much faster than the links); what this
leaves out is `effects.rotor_spin`.
Source: Spong (1987), Modeling and control of elastic joint robots.
"""

from typing import Annotated

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.effects.scale import PART, Scale
from flexlin.mechanics.effects.shared import per_joint
from flexlin.scene.base import AllPositive, PerLink, Unit


class JointFlexibility(Effect):
    """A spring between each motor and its link, the motor's inertia on the link side; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    frees_motors = True
    stiffness: Annotated[AllPositive, Unit("N m/rad")]
    """Stiffness between motor and link."""
    motor_inertia: Annotated[AllPositive, Unit("kg m^2")]
    """Inertia of the motor, seen from the link."""
    damping: Annotated[PerLink, Unit("N m s/rad")] = 0.0
    """Damping between motor and link."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "JointFlexibility":
        """Joints that alone would swing five times as fast as the slowest link, or fifty times as fast as a rigid arm's motion."""
        fast = 5 * scale.bending if scale.bending is not None else 50 * scale.motion
        return cls(stiffness=scale.of_inertias(fast**2), motor_inertia=scale.of_inertias(PART))

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        inertias = [per_joint(self.motor_inertia, i, single="every") for i in chain.moving]
        return ca.dot(ca.vertcat(*inertias), chain.motor_rate**2) / 2

    def potential_energy(self, chain: Chain) -> ca.SX:
        stiffness = [per_joint(self.stiffness, i, single="every") for i in chain.moving]
        return ca.dot(ca.vertcat(*stiffness), (chain.motor - chain.q) ** 2) / 2

    def dissipation(self, chain: Chain) -> ca.SX:
        damping = [per_joint(self.damping, i, single="every") for i in chain.moving]
        return ca.dot(ca.vertcat(*damping), (chain.motor_rate - chain.q_rate) ** 2) / 2
