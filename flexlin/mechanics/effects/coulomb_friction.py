"""Coulomb joint friction: a torque -c tanh(q' / eps) on each joint; eps is the rate below which it counts as sticking.

The linearization takes its slope c / eps (1 - tanh^2(q' / eps)) into D_L: near rest that is a stiff damper, in fast motion nothing. It says
what a small disturbance feels while the joint slides; where the basic motion turns round the slope changes within |q'| of a few eps, and
a disturbance larger than eps in rate feels less than the slope. With `static` the nonlinear
simulation takes friction as the set that it is: at rest it holds up to that much, and the times at which joints stick and slide are found.
Source: Armstrong-Helouvry, Dupont, Canudas de Wit (1994), section 2.
"""

from typing import Annotated

import casadi as ca
from pydantic import model_validator

from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.effects.narrow import Features, Moving, slow_passages
from flexlin.mechanics.effects.scale import LOSS, Scale
from flexlin.mechanics.effects.shared import per_joint
from flexlin.scene.base import AllPositive, PerLink, Unit


class CoulombFriction(Effect):
    """Sliding friction in the joints, of either sign beyond a small rate; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    torque: Annotated[PerLink, Unit("N m")]
    """Sliding friction of each joint."""
    rate: Annotated[AllPositive, Unit("rad/s")] = 0.01
    """Rate at which friction has reached three quarters of it."""
    static: Annotated[PerLink | None, Unit("N m")] = None
    """Friction at rest, at least the sliding one: with it joints stick in the nonlinear simulation, by events."""

    @model_validator(mode="after")
    def _holds_more_than_it_brakes(self) -> "CoulombFriction":
        if self.static is not None:
            count = max(len(one) if isinstance(one, tuple) else 1 for one in (self.torque, self.static))
            pairs = [[per_joint(one, i, single="every") for one in (self.torque, self.static)] for i in range(count)]
            if any(static < sliding for sliding, static in pairs):
                raise ValueError("static of at least torque for each joint, since rest holds more than sliding brakes")
        return self

    @classmethod
    def tried_with(cls, scale: Scale) -> "CoulombFriction":
        return cls(torque=scale.of_inertias(LOSS * scale.motion**2), rate=0.1 * scale.motion)

    def features(self, motion: Moving) -> Features:
        """Where a joint turns round: the slope c / eps lasts while |q'| is a few eps."""
        found: list[tuple[float, float]] = []
        for i in range(motion.joints):
            if per_joint(self.torque, i, single="every") > 0:
                found += slow_passages(motion, i, per_joint(self.rate, i, single="every"))
        return tuple(found)

    def joint_resistance(self, chain: Chain) -> ca.SX:
        joints = chain.moving
        torque, rate = (
            ca.vertcat(*[per_joint(v, i, single="every") for i in joints]) for v in (self.torque, self.rate)
        )
        return torque * ca.tanh(chain.q_rate / rate)
