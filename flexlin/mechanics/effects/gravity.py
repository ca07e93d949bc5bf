"""Gravity: V = -g int (direction . r) dm over links, payload and hubs.

Source: Khang, Dat, Tuan (2019), Eq. (55), where it makes g(s).
"""

from typing import Annotated

import casadi as ca

from flexlin.mechanics.body import unit
from flexlin.mechanics.effects.base import Chain, Effect, Scale
from flexlin.scene.base import Number, Unit
from flexlin.scene.links import Axis


class Gravity(Effect):
    """Gravity, along -y of the world unless another direction is given."""

    smooth = True
    acceleration: Annotated[Number, Unit("m/s^2")] = 9.81
    """Acceleration of gravity."""
    direction: Axis = (0.0, -1.0, 0.0)
    """Where it points, in the world's frame."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "Gravity":
        return cls()

    def potential_energy(self, chain: Chain) -> ca.SX:
        """V = -g direction . sum_bodies int r dm."""
        moments = [body.mass_moment() for body in chain.bodies] + [mass.mass_moment() for mass in chain.masses]
        return self.acceleration * ca.dot(-unit(self.direction), sum(moments, ca.SX(3, 1)))
