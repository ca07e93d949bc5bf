"""Modal damping: each mode of a link loses energy as a damped oscillator of ratio zeta, d_k = 2 zeta_k omega_k m_k.

With omega_k = beta_k^2 sqrt(EI / (rho A l^4)) and m_k = (mode's stiffness) / omega_k^2 of the beam that the shapes belong to.
Source: Craig, Kurdila, Fundamentals of Structural Dynamics (2006), section 10.3.
"""

from typing import Annotated, Optional

import casadi as ca
from pydantic import Field

from flexlin.mechanics.effects.base import LOSS, Chain, Effect, Scale
from flexlin.mechanics.links import Deflection
from flexlin.scene.base import NonNegative, Unit


class ModalDamping(Effect):
    """The same damping ratio on every elastic mode, or one ratio a mode of each link; modes beyond the list have its last ratio."""

    smooth = True
    ratio: Annotated[NonNegative | Annotated[tuple[NonNegative, ...], Field(min_length=1)], Unit("")]
    """Damping ratio of every elastic mode, or one a mode."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["ModalDamping"]:
        return None if scale.bending is None else cls(ratio=LOSS)

    def dissipation(self, chain: Chain) -> ca.SX:
        """R = 1/2 sum_k d_k w_k'^2 over the modes of all links."""
        return sum((self._of(part) for link in chain.links for part in link.deflections), ca.SX(0))

    def _of(self, part: Deflection) -> ca.SX:
        given = self.ratio if isinstance(self.ratio, tuple) else (self.ratio,)
        ratios = ca.vertcat(*[given[min(k, len(given) - 1)] for k in range(part.n)])
        shape = ca.DM(part.basis.stiffness / part.basis.beta**2)
        return part.resistance * ca.dot(ratios * shape, part.w_rate**2)
