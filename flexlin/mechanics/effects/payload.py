"""Payload: T = 1/2 m v^2 + 1/2 J (q' + w'_x(l)')^2 of a rigid body on a link's tip; in space 1/2 w.J w, about a centre anywhere.

Source: Khang, Dat, Tuan (2019), Fig. 1 (m_E); the inertia as in De Luca, Siciliano (1991).
"""

from dataclasses import replace
from typing import Annotated

from flexlin.mechanics.body import RigidMass
from flexlin.mechanics.effects.base import Effect, Scale, at_tip
from flexlin.precision import MINOR
from flexlin.scene.base import Number, PerLink, Unit
from flexlin.scene.links import Inertia, Vector


class Payload(Effect):
    """A rigid body on the tip of the last link, or one a link, that turns with the tip; its centre may lie beyond the tip.

    `inertia` is about z; `centre` and `tensor` say in space what the body on the last tip has beside `offset` and `inertia`.
    """

    smooth = True
    lists = "first"
    vectors = ("centre",)
    inertia_keys = ("mass", "inertia")
    mass: Annotated[PerLink, Unit("kg")]
    """Mass of the payload."""
    inertia: Annotated[PerLink, Unit("kg m^2")] = 0.0
    """Its inertia about its centre, about z."""
    offset: Annotated[Number | tuple[Number, ...], Unit("m")] = 0.0
    """Distance of its centre beyond the tip."""
    centre: Annotated[Vector, Unit("m")] = (0.0, 0.0, 0.0)
    """Its centre seen from the tip, in space."""
    tensor: Annotated[Inertia, Unit("kg m^2")] = Inertia()
    """Its inertia about its centre, in space."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "Payload":
        return cls(mass=MINOR * scale.mass)

    def tip_body(self, link: int, links: int) -> RigidMass:
        body = RigidMass(*(at_tip(value, link, links) for value in (self.mass, self.inertia, self.offset)))
        return replace(body, centre=self.centre, tensor=self.tensor) if link == links - 1 else body
