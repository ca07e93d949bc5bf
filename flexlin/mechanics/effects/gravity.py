"""Gravity: V = g int y dm over links, payload and hubs.

Source: Khang, Dat, Tuan (2019), Eq. (55), where it makes g(s).
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect


class Gravity(Effect):
    """A uniform field along -y of the world."""

    def potential_energy(self, chain: Chain) -> ca.SX:
        """V = g sum_bodies int y dm."""
        return self.table.acceleration * sum((body.mass_moment()[1] for body in chain.bodies), ca.SX(0))
