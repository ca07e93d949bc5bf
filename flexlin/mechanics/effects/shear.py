"""Shear (Timoshenko): the axis deflects by bending and by shear, w = w_b + w_s, and only bending turns the sections, psi = w_b'.

    V = 1/2 int kappa G A (w' - psi)^2 = 1/2 int kappa G A w_s'^2

A link gets coordinates of its own for w_s, along integrated Legendre polynomials. With rotary inertia this is Timoshenko's beam;
kappa G A to infinity leaves Euler-Bernoulli's. Source: Timoshenko (1921).
"""

import casadi as ca

from flexlin.mechanics.effects.base import Chain, Effect, per_joint
from flexlin.mechanics.links import BentLink
from flexlin.scene.links import Link


class Shear(Effect):
    """Shear stiffness kappa G A in N, one a link or one for every link."""

    def shear_functions(self, link: Link) -> int:
        return int(self.table.functions) if link.modes else 0

    def potential_energy(self, chain: Chain) -> ca.SX:
        return sum((self._of_link(link) for link in chain.links if link.bends), ca.SX(0))

    def _of_link(self, link: BentLink) -> ca.SX:
        stiffness = per_joint(self.table.stiffness, link.index, single="every") / ca.SX(link.table.length)
        return stiffness / 2 * ca.bilin(ca.DM(link.integrals.shear), link.w, link.w)
