"""Kelvin-Voigt damping: the material resists the rate of bending, sigma = E (eps + eta eps'), so R = 1/2 eta EI int (w''_t)^2.

Source: Banks, Inman (1991), On damping mechanisms in beams, Eq. (2.2).
"""

from typing import Annotated, Optional

import casadi as ca

from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale, per_joint
from flexlin.scene.base import PerLink, Unit


class KelvinVoigtDamping(Effect):
    """The links' material resists the rate of bending; one retardation time for every link or one a link."""

    smooth = True
    lists = "each"
    retardation_time: Annotated[PerLink, Unit("s")]
    """Resistance to the rate of bending over the stiffness."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["KelvinVoigtDamping"]:
        return None if scale.bending is None else cls(retardation_time=2 * LOSS / scale.bending)

    def dissipation(self, chain: Chain) -> ca.SX:
        times = [per_joint(self.retardation_time, link.index) for link in chain.links]
        strains = [sum(part.strain(part.w_rate) for part in link.deflections) for link in chain.links]
        return sum((eta * strain for eta, strain in zip(times, strains, strict=True)), ca.SX(0))
