"""Geometric (centrifugal) stiffening: a bent link is shorter, u(x) = -1/2 int_0^x (v'^2 + w'^2).

Kept to second order it adds to the moments of the link, with Gamma(x) = int_0^x X' X'^T for each of the two directions,

    first.x += -1/2 v^T (int rhoA Gamma) v,   second.yy, second.zz += -v^T (int rhoA x Gamma) v,

and moves the tip, and with it every link beyond, by u(l). On a single link this is q'^2 G - g sin(q) H in K_L(2, 2). About a rigid motion
that is all; elsewhere the link is the curve of `mechanics.curve`, of which this is the second order.

Source: Simo, Vu-Quoc (1987); Kane, Ryan, Banerjee (1987); Meirovitch, Analytical Methods in Vibrations (1967), section 10.4.
"""

from typing import Optional

import casadi as ca

from flexlin.mechanics.body import Moments, column, tensor
from flexlin.mechanics.effects.base import Effect, Scale
from flexlin.mechanics.links import BentLink


class GeometricStiffening(Effect):
    """The shortening of a bent link, an inextensible curve; linear equations hold its second order."""

    smooth = True
    of_curve = True

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["GeometricStiffening"]:
        return None if scale.bending is None else cls()

    def tip_displacement(self, link: BentLink) -> tuple[ca.SX, ca.SX]:
        drawn = [part.quadratic(part.integrals.tip_shortening, link.table.length) for part in link.bending]
        return tuple(column(-sum(part[i] for part in drawn), 0, 0) for i in (0, 1))

    def link_moments(self, link: BentLink) -> Moments | None:
        if not link.bending:
            return None
        m, length = link.mass, link.table.length
        drawn = [part.quadratic(part.integrals.shortening) for part in link.bending]
        first, rate = (m / length * sum(part[i] for part in drawn) for i in (0, 1))
        turned = [part.square(part.integrals.shortening_moment) for part in link.bending]
        second = -m * sum(turned)
        return Moments(first=column(-first, 0, 0), first_rate=column(-rate, 0, 0), second=tensor(yy=second, zz=second))
