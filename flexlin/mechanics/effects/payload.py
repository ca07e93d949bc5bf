"""Payload: T = 1/2 m v^2 + 1/2 J (q' + w'_x(l)')^2 at the tip of the last link.

Source: Khang, Dat, Tuan (2019), Fig. 1 (m_E); the inertia as in De Luca, Siciliano (1991).
"""

from flexlin.mechanics.body import Body, rigid_body
from flexlin.mechanics.effects.base import Chain, Effect


class Payload(Effect):
    """A rigid body on the tip, turning with the tip's slope."""

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        return (rigid_body(chain.tip, self.table.mass, self.table.inertia),)
