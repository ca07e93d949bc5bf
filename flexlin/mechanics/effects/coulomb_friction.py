"""Coulomb joint friction: a torque -c tanh(q' / eps) on each joint; eps is the rate below which it counts as sticking.

The linearization takes its slope c / eps (1 - tanh^2(q' / eps)) into D_L: near rest that is a stiff damper, in fast motion nothing. It says
what a small disturbance feels while the joint slides; where the basic motion turns round the slope changes within |q'| of a few eps, and
a disturbance larger than eps in rate feels less than the slope. With `static` the nonlinear
simulation takes friction as the set that it is: at rest it holds up to that much, and the times at which joints stick and slide are found.
With `stribeck` lubrication builds up as a joint slides: c = torque + (static - torque) exp(-(q' / stribeck)^2). Its falling branch
is a negative damping, from which joints judder under weak feedback.
Source: Armstrong-Helouvry, Dupont, Canudas de Wit (1994), section 2; Canudas de Wit, Olsson, Astrom, Lischinsky, A new model for control of
systems with friction, IEEE Trans. Automatic Control 40 (1995) 419.
"""

from typing import Annotated, Any, Literal

import casadi as ca
from pydantic import model_validator

from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale, per_joint
from flexlin.mechanics.effects.narrow import Features, Moving, slow_passages
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
    at: Literal["joint", "motor"] = "joint"
    """Whether the bearing behind a flexible joint's spring rubs, or the motor before it with its gear."""
    stribeck: Annotated[AllPositive | None, Unit("rad/s")] = None
    """Rate over which sliding friction falls from `static` to `torque` (Stribeck)."""

    @model_validator(mode="after")
    def _holds_more_than_it_brakes(self) -> "CoulombFriction":
        if self.stribeck is not None and self.static is None:
            raise ValueError("static beside stribeck: the friction from which it falls")
        if self.static is not None and self.at == "motor":
            raise ValueError("no static friction at motors: only joints stick")
        if self.static is not None:
            count = max(len(one) if isinstance(one, tuple) else 1 for one in (self.torque, self.static))
            pairs = [[per_joint(one, i) for one in (self.torque, self.static)] for i in range(count)]
            if any(static < sliding for sliding, static in pairs):
                raise ValueError("static of at least torque for each joint, since rest holds more than sliding brakes")
        return self

    @classmethod
    def tried_with(cls, scale: Scale) -> "CoulombFriction":
        return cls(torque=scale.of_inertias(LOSS * scale.motion**2), rate=0.1 * scale.motion)

    def features(self, motion: Moving) -> Features:
        """Where a joint turns round: the slope c / eps lasts while |q'| is a few eps."""
        rubbed = [i for i in range(motion.joints) if self.sliding(i, 0.0) > 0]
        return tuple(found for i in rubbed for found in slow_passages(motion, i, per_joint(self.rate, i)))

    def sliding(self, joint: int, rate: Any) -> Any:
        """Friction of a joint that slides at a rate, without its sign."""
        torque = per_joint(self.torque, joint)
        if self.stribeck is None or self.static is None:
            return torque
        falls = rate / per_joint(self.stribeck, joint)
        return torque + (per_joint(self.static, joint) - torque) * ca.exp(-(falls**2))

    def joint_resistance(self, chain: Chain) -> ca.SX:
        return self._slide(chain, chain.q_rate) if self.at == "joint" else super().joint_resistance(chain)

    def motor_resistance(self, chain: Chain) -> ca.SX:
        return self._slide(chain, chain.motor_rate) if self.at == "motor" else super().motor_resistance(chain)

    def _slide(self, chain: Chain, rates: ca.SX) -> ca.SX:
        slopes = [per_joint(self.rate, i) for i in chain.moving]
        level = [self.sliding(i, rates[k]) for k, i in enumerate(chain.moving)]
        return ca.vertcat(*level) * ca.tanh(rates / ca.vertcat(*slopes))
