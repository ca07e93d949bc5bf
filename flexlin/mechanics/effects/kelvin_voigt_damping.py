"""Kelvin-Voigt damping: the material resists the rate of bending, sigma = E (eps + eta eps'), so R = 1/2 eta EI int (w''_t)^2.

Source: Banks, Inman (1991), On damping mechanisms in beams, Eq. (2.2).
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint
from flexlin.mechanics.links import BentLink


class KelvinVoigtDamping(Effect):
    """Retardation time eta in s, one a link or one for every link."""

    def dissipation(self, chain: Chain) -> ca.SX:
        return sum((self._of_link(link) for link in chain.links if link.bends), ca.SX(0))

    def _of_link(self, link: BentLink) -> ca.SX:
        eta = per_joint(self.table.retardation_time, link.index, single="every")
        stiffness = eta * ca.SX(link.table.bending_stiffness) / link.table.length**3
        return stiffness / 2 * ca.bilin(ca.DM(link.basis.integrals.bending), link.w_rate, link.w_rate)
