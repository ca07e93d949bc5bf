"""Payload: T = 1/2 m v^2 + 1/2 J (q' + w'_x(l)')^2 of a rigid body on a link's tip.

Source: Khang, Dat, Tuan (2019), Fig. 1 (m_E); the inertia as in De Luca, Siciliano (1991).
"""

from typing import Annotated

from flexlin.mechanics.body import Body, RigidMass, about, rigid_body
from flexlin.mechanics.effects.base import Chain, Effect
from flexlin.mechanics.effects.scale import PART, Scale
from flexlin.mechanics.effects.shared import at_tip
from flexlin.mechanics.frames import Z, column
from flexlin.scene.base import Number, PerLink, Unit


class Payload(Effect):
    """A rigid body on the tip of the last link, or one a link, that turns with the tip; its centre lies `offset` beyond the tip."""

    smooth = True
    lists = "first"
    inertia_keys = ("mass", "inertia")
    mass: Annotated[PerLink, Unit("kg")]
    inertia: Annotated[PerLink, Unit("kg m^2")] = 0.0
    offset: Annotated[Number | tuple[Number, ...], Unit("m")] = 0.0

    @classmethod
    def tried_with(cls, scale: Scale) -> "Payload":
        return cls(mass=PART * scale.mass)

    def tip_body(self, link: int, links: int) -> RigidMass:
        return RigidMass(*(at_tip(value, link, links) for value in (self.mass, self.inertia, self.offset)))

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        links = len(chain.links)
        on = [self.tip_body(link, links) for link in range(links)]
        return tuple(
            rigid_body(frame, body.mass, about(Z, body.inertia), column(body.offset, 0, 0))
            for frame, body in zip(chain.tips, on, strict=True)
        )
