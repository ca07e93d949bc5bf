"""Rayleigh damping: R = 1/2 w'^T (alpha M + beta K) w' with each link's own elastic mass and bending stiffness.

A mode of frequency omega has the ratio (alpha / omega + beta omega) / 2. Source: Rayleigh, Theory of Sound (1877), section 97.
"""

from typing import Annotated, Optional

import casadi as ca

from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale
from flexlin.mechanics.links import Deflection
from flexlin.scene.base import NonNegative, Unit


class RayleighDamping(Effect):
    """alpha M + beta K on the elastic coordinates of every link that bends."""

    smooth = True
    mass_factor: Annotated[NonNegative, Unit("1/s")] = 0.0
    """alpha, on the mass matrix."""
    stiffness_factor: Annotated[NonNegative, Unit("s")] = 0.0
    """beta, on the stiffness matrix."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["RayleighDamping"]:
        return None if scale.bending is None else cls(stiffness_factor=2 * LOSS / scale.bending)

    def dissipation(self, chain: Chain) -> ca.SX:
        return sum((self._of(part) for link in chain.links for part in link.deflections), ca.SX(0))

    def _of(self, part: Deflection) -> ca.SX:
        return self.mass_factor * part.inertia_form() / 2 + self.stiffness_factor * part.strain(part.w_rate)
