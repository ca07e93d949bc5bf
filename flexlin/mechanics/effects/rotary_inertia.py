"""Rotary inertia: the sections of a link turn, T = 1/2 int rho I (q' + psi')^2, psi = w'_x without shear.

With the radius of gyration r, rho I = rho A r^2. Source: Rayleigh, Theory of Sound (1877), section 186.
"""

from typing import TYPE_CHECKING, Annotated, Any

import casadi as ca

from flexlin.mechanics.body import Moments, about
from flexlin.mechanics.effects.base import Effect
from flexlin.mechanics.effects.scale import SLENDERNESS, Scale
from flexlin.mechanics.effects.shared import per_joint
from flexlin.mechanics.frames import Z
from flexlin.scene.base import PerLink, Unit

if TYPE_CHECKING:
    from flexlin.mechanics.links import BentLink


class RotaryInertia(Effect):
    """The inertia of the links' sections, by their radius of gyration sqrt(I/A); one number for every link or one a link."""

    smooth = True
    lists = "each"
    radius_of_gyration: Annotated[PerLink, Unit("m")]
    """Radius of gyration sqrt(I/A) of the sections."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "RotaryInertia":
        return cls(radius_of_gyration=tuple(SLENDERNESS * link.length for link in scale.links))

    def section_gyration(self, link: int) -> Any:
        return per_joint(self.radius_of_gyration, link, single="every")

    def link_moments(self, link: "BentLink") -> Moments | None:
        k, length = link.basis.integrals, link.table.length
        radius = per_joint(self.radius_of_gyration, link.index, single="every")
        inertia = link.mass * radius**2
        return Moments(
            second=about(Z, inertia * k.section),
            swirl=Z * (inertia / length * ca.dot(ca.DM(k.rotation), link.w_rate)) if link.bends else ca.SX(3, 1),
            agitation=inertia / length**2 * ca.bilin(ca.DM(k.rotations), link.w_rate, link.w_rate)
            if link.bends
            else ca.SX(0),
        )
