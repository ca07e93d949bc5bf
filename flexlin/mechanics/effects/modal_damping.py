"""Modal damping: each mode of a clamped link loses energy as a damped oscillator of ratio zeta.

    D = 2 zeta G^(1/2) (G^(-1/2) K G^(-1/2))^(1/2) G^(1/2)     (2 zeta omega_k m_k for orthogonal modes)

with the link's own mass matrix rhoA l G and stiffness EI/l^3 K. Source: Craig, Kurdila, Fundamentals of Structural Dynamics (2006), 10.3.
"""

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.links import BentLink


class ModalDamping(Effect):
    """The same ratio on every mode, or a tuple of ratios in the order of the modes."""

    def dissipation(self, chain: Chain) -> ca.SX:
        """R = 1/2 sum_links w'^T D w'."""
        return sum((self._of_link(link) for link in chain.links if link.table.modes), ca.SX(0))

    def _of_link(self, link: BentLink) -> ca.SX:
        ratios, table = self.table.ratio, link.table
        per_mode = ratios if isinstance(ratios, tuple) else (ratios,) * table.modes
        scale = ca.sqrt(link.mass * table.bending_stiffness / table.length**3)
        vectors = ca.DM(modal_vectors(link.integrals.gram, link.integrals.bending))
        rates = vectors @ link.w_rate
        return scale * ca.dot(ca.vertcat(*per_mode), rates**2)


def modal_vectors(gram: Array, bending: Array) -> Array:
    """Rows that map w' to sqrt(omega_k) times the rate of the k-th mass-normalised mode, (n, n), dimensionless."""
    inverse_root = np.linalg.inv(np.linalg.cholesky(gram))
    squares, modes = np.linalg.eigh(inverse_root @ bending @ inverse_root.T)
    return np.sqrt(np.sqrt(squares))[:, None] * (modes.T @ np.linalg.inv(inverse_root).T)
