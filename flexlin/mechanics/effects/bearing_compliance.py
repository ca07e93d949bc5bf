"""Bearing compliance: a joint's axis tilts about both axes across it, V = 1/2 k (beta_1^2 + beta_2^2), R = 1/2 d (beta_1'^2 + beta_2'^2).

The joint turns about its tilted axis: R = R_mount exp((beta_1 e_1 + beta_2 e_2)~) exp(q a~), kept to second order in beta. Of a sliding
joint beta_1, beta_2 are displacements across its direction. Assumes bearings that give alike in both directions.
Source: Genta, Dynamics of Rotating Systems (2005), section 4.6.
"""

from collections.abc import Sequence
from typing import Annotated, Any

import casadi as ca

from flexlin.mechanics.body import Body, Moments, about
from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale, per_joint
from flexlin.precision import MINOR
from flexlin.scene.base import NonNegative, PerLink, Positive, Unit


class BearingCompliance(Effect):
    """Bearings that give across each joint's direction; one number for every joint or one a joint."""

    smooth = True
    lists = "each"
    frees_bearings = True
    stiffness: Annotated[Positive | tuple[NonNegative, ...], Unit("N m/rad")]
    """Stiffness against tilting (N/m across a sliding joint); 0 in a list for a bearing that does not give."""
    damping: Annotated[PerLink, Unit("N m s/rad")] = 0.0
    """Damping of the tilting (N s/m across a sliding joint)."""
    inertia: Annotated[PerLink, Unit("kg m^2")] = 0.0
    """Inertia about the axes across a turning joint of what turns in its bearing, which a link that is a slender rod lacks."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "BearingCompliance":
        """Bearings on which the joints alone would swing five times as fast as the slowest link, or fifty times as a rigid arm's motion."""
        losses = scale.of_inertias(2 * LOSS * scale.fast)
        return cls(stiffness=scale.of_inertias(scale.fast**2), inertia=scale.of_inertias(MINOR), damping=losses)

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        turning = [i for i in chain.moving if chain.links[i].table.joint == "revolute"]
        return tuple(Body(chain.joints[i], Moments(second=self._across(chain, i))) for i in turning)

    def _across(self, chain: Chain, joint: int) -> ca.SX:
        """J (E - a a^T), (3, 3)."""
        inertia = per_joint(self.inertia, joint)
        return ca.sparsify(ca.SX(inertia) * ca.SX.eye(3) - about(chain.axes[joint], inertia))

    def potential_energy(self, chain: Chain) -> ca.SX:
        return self._sum_squares(self.stiffness, chain.bearings, chain)

    def dissipation(self, chain: Chain) -> ca.SX:
        return self._sum_squares(self.damping, chain.bearing_rates, chain)

    def _sum_squares(self, value: Any, parts: Sequence[ca.SX], chain: Chain) -> ca.SX:
        """1/2 sum k x.x over the bearings."""
        squares = [per_joint(value, i) / 2 * ca.sumsqr(parts[i]) for i in chain.moving]
        return sum(squares, ca.SX(0))
