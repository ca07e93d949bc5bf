"""Rayleigh damping: R = 1/2 w'^T (alpha M + beta K) w' with each link's own elastic mass and bending stiffness.

A mode of frequency omega has the ratio (alpha / omega + beta omega) / 2. Source: Rayleigh, Theory of Sound (1877), section 97.
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.links import BentLink


class RayleighDamping(Effect):
    """`mass_factor` alpha in 1/s, `stiffness_factor` beta in s, on every link that bends."""

    def dissipation(self, chain: Chain) -> ca.SX:
        return sum((self._of_link(link) for link in chain.links if link.bends), ca.SX(0))

    def _of_link(self, link: BentLink) -> ca.SX:
        k, table = link.basis.integrals, link.table
        stiffness = ca.SX(table.bending_stiffness) / table.length**3
        mass = self.table.mass_factor * link.mass * ca.bilin(ca.DM(k.gram), link.w_rate, link.w_rate)
        return (
            mass + self.table.stiffness_factor * stiffness * ca.bilin(ca.DM(k.bending), link.w_rate, link.w_rate)
        ) / 2
