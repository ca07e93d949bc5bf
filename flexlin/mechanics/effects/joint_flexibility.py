"""Joint flexibility: each motor has a coordinate theta of its own behind a spring, V = 1/2 k (theta - q)^2, T = 1/2 J_m theta'^2,
R = 1/2 d (theta' - q')^2.

Assumes the motor's inertia, reflected to the link side, sees its own rate only (gears turn it much faster than the links); what this
leaves out is `effects.rotor_spin`.
Source: Spong (1987), Modeling and control of elastic joint robots.
"""

from collections.abc import Iterator
from typing import Annotated

import casadi as ca

from flexlin.errors import Problem
from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale, per_motor
from flexlin.precision import MINOR
from flexlin.scene.base import NonNegative, PerLink, Positive, Unit
from flexlin.scene.effects import RawArm, RawTable


class JointFlexibility(Effect):
    """A spring between each motor and its link, the motor's inertia on the link side; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    frees_motors = True
    stiffness: Annotated[Positive | tuple[NonNegative, ...], Unit("N m/rad")]
    """Stiffness between motor and link; 0 in a list for a joint that is stiff."""
    motor_inertia: Annotated[Positive | tuple[NonNegative, ...], Unit("kg m^2")]
    """Inertia of the motor, seen from the link."""
    damping: Annotated[PerLink, Unit("N m s/rad")] = 0.0
    """Damping between motor and link."""

    @classmethod
    def contradictions(cls, raw: RawTable, arm: RawArm) -> Iterator[Problem]:
        """A motor behind a spring has inertia."""
        tables = [raw.get(key) for key in ("stiffness", "motor_inertia")]
        for i in range(len(arm.links)):
            springs, inertias = (t[i : i + 1] if isinstance(t, list) else [t] for t in tables)
            if springs != [0] and inertias == [0]:
                yield Problem(f"effects.joint_flexibility.motor_inertia.{i}", "0", "a positive number behind a spring")

    @classmethod
    def tried_with(cls, scale: Scale) -> "JointFlexibility":
        """Joints that alone would swing five times as fast as the slowest link, or fifty times as fast as a rigid arm's motion."""
        losses = scale.of_inertias(2 * LOSS * scale.fast)
        return cls(stiffness=scale.of_inertias(scale.fast**2), motor_inertia=scale.of_inertias(MINOR), damping=losses)

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        return ca.dot(per_motor(self.motor_inertia, chain), chain.motor_rate**2) / 2

    def potential_energy(self, chain: Chain) -> ca.SX:
        return ca.dot(per_motor(self.stiffness, chain), (chain.motor - chain.q) ** 2) / 2

    def dissipation(self, chain: Chain) -> ca.SX:
        return ca.dot(per_motor(self.damping, chain), (chain.motor_rate - chain.q_rate) ** 2) / 2
