"""A force and a torque at the tip of the last link: their power is P = v . F + w . T, and the generalized forces are dP/ds'.

Constant in the world's axes (a dead load), or in the tip's, with which they turn (a follower, such as a jet); times a harmonic
cos(2 pi k t/T + phase) of the basic motion, or times the square of the first joint's rate, (q_1'/rate)^2. A column buckles under them
only with `geometric_stiffening`: the shortening of the bent link is what an axial force works on.

Source: Bolotin, Nonconservative Problems of the Theory of Elastic Stability (1963), chapter 2.
"""

from math import pi
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, model_validator

from flexlin.mechanics.body import column
from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.scene.base import Number, Positive, Unit
from flexlin.scene.links import Vector


class TipForce(Effect):
    """A force and a torque at the tip of the last link, in the world's axes or in the tip's, constant or periodic."""

    smooth = True
    vectors = ("force", "torque")
    force: Annotated[Vector, Unit("N")] = (0.0, 0.0, 0.0)
    """Force on the tip."""
    torque: Annotated[Vector, Unit("N m")] = (0.0, 0.0, 0.0)
    """Torque on the tip."""
    frame: Literal["world", "tip"] = "world"
    """Whose axes these are given in: the tip's turn with it."""
    harmonic: Annotated[int, Field(strict=True, ge=0, le=60)] = 0
    """How often the load goes to and fro in a period of the motion; 0: it is constant."""
    phase: Annotated[Number, Unit("rad")] = 0.0
    """Phase of a periodic load: 0 has its largest value at t = 0."""
    rate: Annotated[Positive | None, Unit("rad/s")] = None
    """Rate of the first joint at which a load that grows with its square, alike to and fro, has this size; none: it does not."""

    @model_validator(mode="after")
    def _has_a_phase_if_periodic(self) -> "TipForce":
        if self.phase and not self.harmonic:
            raise ValueError("harmonic of at least 1 beside phase, since a constant load has none")
        return self

    def power(self, chain: Chain) -> ca.SX:
        tip, loads = chain.tips[-1], (column(*self.force), column(*self.torque))
        force, torque = loads if self.frame == "tip" else (tip.rotation.T @ load for load in loads)
        wave = ca.cos(2 * pi * self.harmonic * chain.phase + self.phase) if self.harmonic else 1
        grown = 1 if self.rate is None else (chain.seen_rate / self.rate) ** 2
        return wave * grown * (ca.dot(tip.velocity, force) + ca.dot(tip.spin, torque))
