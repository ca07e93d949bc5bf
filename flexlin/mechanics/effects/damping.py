"""Damping of the links by Rayleigh's dissipation function R.

Modal: each mode loses energy as a damped oscillator of ratio zeta, d_k = 2 zeta_k omega_k m_k, with
omega_k = beta_k^2 sqrt(EI / (rho A l^4)) and m_k = (mode's stiffness) / omega_k^2 of the beam that the shapes belong to.
Rayleigh: R = 1/2 w'^T (alpha M + beta K) w' with each link's own elastic mass and bending stiffness; a mode of frequency omega has the
ratio (alpha / omega + beta omega) / 2.
Kelvin-Voigt: the material resists the rate of bending, sigma = E (eps + eta eps'), so R = 1/2 eta EI int (w''_t)^2.

Source: Craig, Kurdila, Fundamentals of Structural Dynamics (2006), section 10.3; Rayleigh, Theory of Sound (1877), section 97; Banks, Inman
(1991), On damping mechanisms in beams, Eq. (2.2).
"""

from typing import TYPE_CHECKING, Annotated, Optional

import casadi as ca
from pydantic import Field

from flexlin.mechanics.effects.base import SMALL, Chain, Effect, Scale, per_joint
from flexlin.scene.base import NonNegative, PerLink, Unit

if TYPE_CHECKING:
    from flexlin.mechanics.links import BentLink, Deflection


class ModalDamping(Effect):
    """The same damping ratio on every elastic mode, or one ratio a mode of each link; modes beyond the list have its last ratio."""

    smooth = True
    ratio: Annotated[NonNegative | Annotated[tuple[NonNegative, ...], Field(min_length=1)], Unit("")]
    """Damping ratio of every elastic mode, or one a mode."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["ModalDamping"]:
        return None if scale.bending is None else cls(ratio=SMALL)

    def dissipation(self, chain: Chain) -> ca.SX:
        """R = 1/2 sum_k d_k w_k'^2 over the modes of all links."""
        return sum((self._of(part) for link in chain.links for part in link.deflections), ca.SX(0))

    def _of(self, part: "Deflection") -> ca.SX:
        given = self.ratio if isinstance(self.ratio, tuple) else (self.ratio,)
        ratios = ca.vertcat(*[given[min(k, len(given) - 1)] for k in range(part.n)])
        shape = ca.DM(part.basis.stiffness / part.basis.beta**2)
        return part.resistance * ca.dot(ratios * shape, part.w_rate**2)


class RayleighDamping(Effect):
    """alpha M + beta K on the elastic coordinates of every link that bends."""

    smooth = True
    mass_factor: Annotated[NonNegative, Unit("1/s")] = 0.0
    """alpha, on the mass matrix."""
    stiffness_factor: Annotated[NonNegative, Unit("s")] = 0.0
    """beta, on the stiffness matrix."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["RayleighDamping"]:
        return None if scale.bending is None else cls(stiffness_factor=2 * SMALL / scale.bending)

    def dissipation(self, chain: Chain) -> ca.SX:
        return sum((self._of(part) for link in chain.links for part in link.deflections), ca.SX(0))

    def _of(self, part: "Deflection") -> ca.SX:
        stiffness = self.stiffness_factor * part.rigidity
        bending = ca.bilin(ca.DM(part.integrals.bending), part.w_rate, part.w_rate)
        return (self.mass_factor * part.inertia_form() + stiffness * bending) / 2


class KelvinVoigtDamping(Effect):
    """The links' material resists the rate of bending; one retardation time for every link or one a link."""

    smooth = True
    lists = "each"
    retardation_time: Annotated[PerLink, Unit("s")]
    """Resistance to the rate of bending over the stiffness."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["KelvinVoigtDamping"]:
        return None if scale.bending is None else cls(retardation_time=2 * SMALL / scale.bending)

    def dissipation(self, chain: Chain) -> ca.SX:
        return sum((self._of_link(link) for link in chain.links), ca.SX(0))

    def _of_link(self, link: "BentLink") -> ca.SX:
        eta = per_joint(self.retardation_time, link.index)
        forms = [
            part.rigidity * ca.bilin(ca.DM(part.integrals.bending), part.w_rate, part.w_rate)
            for part in link.deflections
        ]
        return eta / 2 * sum(forms, ca.SX(0))
