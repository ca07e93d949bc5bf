"""Rigid bodies on the links.

Payload: T = 1/2 m v^2 + 1/2 J (q' + w'_x(l)')^2 of a rigid body on a link's tip; in space 1/2 w.J w, about a centre anywhere.

Source: Khang, Dat, Tuan (2019), Fig. 1 (m_E); the inertia as in De Luca, Siciliano (1991).

Hub: T = 1/2 m v^2 + 1/2 J1 (w . axis)^2 of a rigid body on each joint; its radius moves the link out, x -> x + r.

Source: Khang, Dat, Tuan (2019), Eq. (68) (J1).
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import casadi as ca

from flexlin.errors import Problem
from flexlin.mechanics.body import Body, RigidMass, about, column, rigid_body, tensor
from flexlin.mechanics.effects.base import PART, Chain, Effect, Scale, at_tip, per_joint
from flexlin.scene.base import Number, PerLink, Unit
from flexlin.scene.consistency import pinned
from flexlin.scene.effects import RawArm, RawTable
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
        return cls(mass=PART * scale.mass)

    def tip_body(self, link: int, links: int) -> RigidMass:
        body = RigidMass(*(at_tip(value, link, links) for value in (self.mass, self.inertia, self.offset)))
        return replace(body, centre=self.centre, tensor=self.tensor) if link == links - 1 else body

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        links = len(chain.links)
        on = [self.tip_body(link, links) for link in range(links)]
        return tuple(
            rigid_body(frame, body.mass, self._inertia(body), self._centre(body))
            for frame, body in zip(chain.tips, on, strict=True)
            if not body.is_nothing
        )

    def _centre(self, body: RigidMass) -> ca.SX:
        """Centre (3, 1) of the body on a tip."""
        x, y, z = body.centre
        return column(body.offset + x, y, z)

    def _inertia(self, body: RigidMass) -> ca.SX:
        """Inertia (3, 3) of the body on a tip."""
        extra = (Inertia() if body.tensor is None else body.tensor).entries()
        return tensor(**extra | {"zz": extra["zz"] + body.inertia})


class Hub(Effect):
    """A rigid body that turns with each link about its joint; a single number stands for the first joint only."""

    smooth = True
    lists = "first"
    inertia_keys = ("mass", "inertia")
    inertia: Annotated[PerLink, Unit("kg m^2")] = 0.0
    """Inertia about the joint."""
    mass: Annotated[PerLink, Unit("kg")] = 0.0
    """Mass at the joint."""
    radius: Annotated[PerLink, Unit("m")] = 0.0
    """Distance from the joint at which the link begins."""

    @classmethod
    def tried_with(cls, scale: Scale) -> "Hub":
        return cls(inertia=scale.of_inertias(PART))

    @classmethod
    def contradictions(cls, raw: RawTable, arm: RawArm) -> Iterator[Problem]:
        """A hub that pinned shapes turn has no radius."""
        radius = raw.get("radius", 0)
        of = radius if isinstance(radius, list) else [radius]
        for i, (own, link) in enumerate(zip(of, arm.links, strict=False)):
            if own and pinned(link):
                yield Problem(
                    "effects.hub.radius", f"{own} on joint {i + 1}", "0 on a joint whose link has pinned shapes"
                )

    def joint_radius(self, joint: int) -> Any:
        return per_joint(self.radius, joint, single="first")

    def joint_body(self, joint: int) -> RigidMass:
        mass, inertia = (per_joint(value, joint, single="first") for value in (self.mass, self.inertia))
        return RigidMass(mass, inertia)

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        on = [self.joint_body(joint) for joint in range(len(chain.joints))]
        return tuple(
            rigid_body(frame, body.mass, about(axis, body.inertia))
            for frame, axis, body in zip(chain.joints, chain.axes, on, strict=True)
            if not body.is_nothing
        )
