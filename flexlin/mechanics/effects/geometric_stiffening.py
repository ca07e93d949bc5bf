"""Geometric (centrifugal) stiffening: a bent link is shorter, u(x) = -1/2 int_0^x w'^2.

Kept to second order in w it adds to the moments of the link, with Gamma(x) = int_0^x X' X'^T,

    first.x += -1/2 w^T (int rhoA Gamma) w,   second += -w^T (int rhoA x Gamma) w,

and moves the tip, and with it every link beyond, by u(l). On a single link this is q'^2 G - g sin(q) H in K_L(2, 2).

Source: Simo, Vu-Quoc (1987); Kane, Ryan, Banerjee (1987); Meirovitch, Analytical Methods in Vibrations (1967), section 10.4.
"""

from typing import TYPE_CHECKING, Optional

import casadi as ca

from flexlin.mechanics.body import Moments, tensor
from flexlin.mechanics.effects.base import Effect
from flexlin.mechanics.effects.scale import Scale
from flexlin.mechanics.frames import column

if TYPE_CHECKING:
    from flexlin.mechanics.links import BentLink


class GeometricStiffening(Effect):
    """The shortening of a bent link, kept to second order in kinetic and potential energy."""

    smooth = True

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["GeometricStiffening"]:
        return None if scale.bending is None else cls()

    def tip_shortening(self, link: "BentLink") -> tuple[ca.SX, ca.SX]:
        gamma = ca.DM(link.basis.integrals.tip_shortening) / link.table.length
        return -ca.bilin(gamma, link.w, link.w) / 2, -ca.bilin(gamma, link.w, link.w_rate)

    def link_moments(self, link: "BentLink") -> Moments | None:
        if not link.bends:
            return None
        k = link.basis.integrals
        along = link.mass / link.table.length * ca.DM(k.shortening)
        drawn_in = -link.mass * ca.bilin(ca.DM(k.shortening_moment), link.w, link.w)
        return Moments(
            first=column(-ca.bilin(along, link.w, link.w) / 2, 0, 0),
            first_rate=column(-ca.bilin(along, link.w, link.w_rate), 0, 0),
            second=tensor(yy=drawn_in, zz=drawn_in),
        )
