"""Gravity: V = g int y dm over links, payload and hubs.

Source: Khang, Dat, Tuan (2019), Eq. (55), where it makes g(s).
"""

from typing import Annotated

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.effects.scale import Scale
from flexlin.scene.base import Number, Unit


class Gravity(Effect):
    """Gravity in the plane of motion, along -y of the world."""

    smooth = True
    acceleration: Annotated[Number, Unit("m/s^2")] = 9.81

    @classmethod
    def tried_with(cls, scale: Scale) -> "Gravity":
        return cls()

    def potential_energy(self, chain: Chain) -> ca.SX:
        """V = g sum_bodies int y dm."""
        return self.acceleration * sum((body.mass_moment()[1] for body in chain.bodies), ca.SX(0))
