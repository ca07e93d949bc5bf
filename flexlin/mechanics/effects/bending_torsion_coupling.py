"""Coupling of bending and twist: a twisted section bends about its own axes, so the axis moves across to second order.

With curvatures v'', w'' and twist phi' measured in the sections' axes, R' = R kappa~ and r' = R e_x give to second order

    v2(x) = -int_0^x (x - s) phi w'' ds,   w2(x) = int_0^x (x - s) phi v'' ds,   theta2 = 1/2 int theta x theta' ds

beside the shortening of `geometric_stiffening`, with theta = (phi, -w', v'). The elastic energy stays quadratic. A load across the stiff
plane then does work on phi and v'' together: the beam buckles sideways. Elsewhere than about a rigid motion the link is the curve of
`mechanics.curve`, of which this is the second order.

Source: Hodges, Dowell, NASA TN D-7818 (1974), whose curvatures these are; Timoshenko, Gere, Theory of Elastic Stability (1961),
section 6.3, for what follows.
"""

from typing import Any, Optional

import casadi as ca

from flexlin.mechanics.beam.integrals import Couplings
from flexlin.mechanics.body import Moments, column, tensor
from flexlin.mechanics.effects.base import Effect, Scale
from flexlin.mechanics.links import BentLink, product


class BendingTorsionCoupling(Effect):
    """What twist and bending in two planes do together, kept to second order in kinetic and potential energy."""

    smooth = True
    of_curve = True

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["BendingTorsionCoupling"]:
        return None if scale.bending is None else cls()

    def tip_displacement(self, link: BentLink) -> tuple[ca.SX, ca.SX]:
        if link.couplings is None:
            return ca.SX(3, 1), ca.SX(3, 1)
        (across, across_rate), (up, up_rate) = with_twist(link, link.couplings, "tip")
        return column(0, -across, up), column(0, -across_rate, up_rate)

    def tip_turn(self, link: BentLink) -> tuple[ca.SX, ca.SX]:
        if link.couplings is None:
            return ca.SX(3, 1), ca.SX(3, 1)
        return tuple(column(*part) for part in link.second_turns(link.couplings.turn))

    def link_moments(self, link: BentLink) -> Moments | None:
        k, m, length = link.couplings, link.mass, link.table.length
        if k is None:
            return None
        (v, v_rate), (w, w_rate) = with_twist(link, k, "mass")
        (mv, mv_rate), (mw, mw_rate) = with_twist(link, k, "moment")
        return Moments(
            first=column(0, -m * v, m * w),
            first_rate=column(0, -m * v_rate, m * w_rate),
            second=tensor(xy=m * length * mv, xz=-m * length * mw),
            swirl=column(0, -m * length * mw_rate, -m * length * mv_rate),
        )


def with_twist(link: BentLink, k: Couplings, name: str) -> list[tuple[Any, Any]]:
    """The products of twist with bending in z and in y, and their rates."""
    in_y, in_z = getattr(k, name)
    return [product(in_z, link.torsion, link.z), product(in_y, link.torsion, link.y)]
