"""Joints that give: springs behind the motors, and bearings.

Joint flexibility: each motor has a coordinate theta of its own behind a spring, V = 1/2 k (theta - q)^2, T = 1/2 J_m theta'^2,
R = 1/2 d (theta' - q')^2.

Assumes the motor's inertia, reflected to the link side, sees its own rate only (gears turn it much faster than the links); what this
leaves out is `effects.rotor_spin`.
Source: Spong (1987), Modeling and control of elastic joint robots.

Bearing compliance: a joint's axis tilts about both axes across it, V = 1/2 k (beta_1^2 + beta_2^2), R = 1/2 d (beta_1'^2 + beta_2'^2).

The joint turns about its tilted axis: R = R_mount exp((beta_1 e_1 + beta_2 e_2)~) exp(q a~), kept to second order in beta. Of a sliding
joint beta_1, beta_2 are displacements across its direction. Assumes bearings that give alike in both directions.
Source: Genta, Dynamics of Rotating Systems (2005), section 4.6.
"""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import casadi as ca

from flexlin.errors import Problem
from flexlin.mechanics.body import Body, about, rigid_body
from flexlin.mechanics.effects.base import PART, SMALL, Chain, Effect, Scale, per_joint, per_motor
from flexlin.scene.base import NonNegative, PerLink, Positive, Unit
from flexlin.scene.effects import RawArm, RawTable


def count_soft(stiffness: Any, moving: Sequence[int]) -> int:
    """How many of these joints a raw stiffness lets give: 0 in a list stands for none."""
    return sum(not isinstance(stiffness, list) or i >= len(stiffness) or stiffness[i] != 0 for i in moving)


def is_soft(stiffness: Any, joint: int) -> bool:
    """Whether a joint gives; a symbol does."""
    own = per_joint(stiffness, joint)
    return not isinstance(own, (int, float)) or own > 0


def choose_fast(scale: Scale) -> float:
    """Five times as fast as the slowest link, or fifty times as a rigid arm's motion, in rad/s."""
    return 5 * scale.bending if scale.bending is not None else 50 * scale.motion


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
    def count_motors(cls, raw: RawTable, moving: Sequence[int]) -> int:
        return count_soft(raw.get("stiffness"), moving)

    @classmethod
    def contradictions(cls, raw: RawTable, arm: RawArm) -> Iterator[Problem]:
        """A motor behind a spring has inertia."""
        tables = [raw.get(key) for key in ("stiffness", "motor_inertia")]
        for i in range(len(arm.links)):
            springs, inertias = (t[i : i + 1] if isinstance(t, list) else [t] for t in tables)
            if springs != [0] and inertias == [0]:
                yield Problem(f"effects.joint_flexibility.motor_inertia.{i}", "0", "a positive number behind a spring")

    def frees_motor(self, joint: int) -> bool:
        return is_soft(self.stiffness, joint)

    @classmethod
    def tried_with(cls, scale: Scale) -> "JointFlexibility":
        """Joints that alone would swing five times as fast as the slowest link, or fifty times as fast as a rigid arm's motion."""
        fast = choose_fast(scale)
        losses = scale.of_inertias(2 * SMALL * fast)
        return cls(stiffness=scale.of_inertias(fast**2), motor_inertia=scale.of_inertias(PART), damping=losses)

    def kinetic_energy(self, chain: Chain) -> ca.SX:
        return ca.dot(per_motor(self.motor_inertia, chain), chain.motor_rate**2) / 2

    def potential_energy(self, chain: Chain) -> ca.SX:
        return ca.dot(per_motor(self.stiffness, chain), (chain.motor - chain.q) ** 2) / 2

    def dissipation(self, chain: Chain) -> ca.SX:
        return ca.dot(per_motor(self.damping, chain), (chain.motor_rate - chain.q_rate) ** 2) / 2


class BearingCompliance(Effect):
    """Bearings that give across each joint's direction; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    frees_bearings = True
    stiffness: Annotated[Positive | tuple[NonNegative, ...], Unit("N m/rad")]
    """Stiffness against tilting (N/m across a sliding joint); 0 in a list for a bearing that does not give."""
    damping: Annotated[PerLink, Unit("N m s/rad")] = 0.0
    """Damping of the tilting (N s/m across a sliding joint)."""
    inertia: Annotated[PerLink, Unit("kg m^2")] = 0.0
    """Inertia about the axes across a turning joint of what turns in its bearing, which a link that is a slender rod lacks."""

    @classmethod
    def count_bearings(cls, raw: RawTable, moving: Sequence[int]) -> int:
        return count_soft(raw.get("stiffness"), moving)

    def frees_bearing(self, joint: int) -> bool:
        return is_soft(self.stiffness, joint)

    @classmethod
    def tried_with(cls, scale: Scale) -> "BearingCompliance":
        """Bearings on which the joints alone would swing five times as fast as the slowest link, or fifty times as a rigid arm's motion."""
        fast = choose_fast(scale)
        losses = scale.of_inertias(2 * SMALL * fast)
        return cls(stiffness=scale.of_inertias(fast**2), inertia=scale.of_inertias(PART), damping=losses)

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        """J (E - a a^T) of what turns in the bearings."""
        turning = [i for i in chain.moving if chain.links[i].table.joint == "revolute"]
        inertias = [per_joint(self.inertia, i) for i in turning]
        across = [
            ca.sparsify(J * ca.SX.eye(3) - about(chain.axes[i], J)) for i, J in zip(turning, inertias, strict=True)
        ]
        return tuple(rigid_body(chain.joints[i], 0.0, J) for i, J in zip(turning, across, strict=True))

    def potential_energy(self, chain: Chain) -> ca.SX:
        energies = [per_joint(self.stiffness, i) / 2 * ca.sumsqr(chain.bearings[i]) for i in chain.moving]
        return sum(energies, ca.SX(0))

    def dissipation(self, chain: Chain) -> ca.SX:
        rates = chain.bearing_rates
        losses = [per_joint(self.damping, i) / 2 * ca.sumsqr(rates[i]) for i in chain.moving]
        return sum(losses, ca.SX(0))
