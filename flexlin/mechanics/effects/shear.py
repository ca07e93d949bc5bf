"""Shear (Timoshenko): the axis' slope and the section's rotation part, V = 1/2 int kappa G A (w' - psi)^2.

Each assumed mode has a deflection X and a rotation psi of its own, the modes of Timoshenko's beam with these ends; so shear adds no
coordinate, and none of the fast motions in which the sections turn against the axis. With rotary inertia this is Timoshenko's beam;
kappa G A to infinity leaves Euler-Bernoulli's. Source: Timoshenko (1921).
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint
from flexlin.mechanics.links import BentLink


class Shear(Effect):
    """Shear stiffness kappa G A in N, one a link or one for every link."""

    def potential_energy(self, chain: Chain) -> ca.SX:
        return sum((self._of_link(link) for link in chain.links if link.bends), ca.SX(0))

    def _of_link(self, link: BentLink) -> ca.SX:
        stiffness = per_joint(self.table.stiffness, link.index, single="every") / ca.SX(link.table.length)
        return stiffness / 2 * ca.bilin(ca.DM(link.basis.integrals.shear), link.w, link.w)
