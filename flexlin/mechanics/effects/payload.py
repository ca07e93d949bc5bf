"""Payload: T = 1/2 m v^2 + 1/2 J (q' + w'_x(l)')^2 of a rigid body on a link's tip.

Source: Khang, Dat, Tuan (2019), Fig. 1 (m_E); the inertia as in De Luca, Siciliano (1991).
"""

import casadi as ca

from flexlin.mechanics.body import Body, rigid_body
from flexlin.mechanics.effects.base import Chain, Effect, at_tip


class Payload(Effect):
    """A rigid body on the tip, turning with the tip's slope; its centre lies `offset` beyond the tip."""

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        table, links = self.table, len(chain.links)
        return tuple(
            rigid_body(
                frame,
                at_tip(table.mass, i, links),
                at_tip(table.inertia, i, links),
                ca.vertcat(at_tip(table.offset, i, links), 0),
            )
            for i, frame in enumerate(chain.tips)
        )
