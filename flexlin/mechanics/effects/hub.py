"""Hub: T = 1/2 m v^2 + 1/2 J1 (w . axis)^2 of a rigid body on each joint; its radius moves the link out, x -> x + r.

Source: Khang, Dat, Tuan (2019), Eq. (68) (J1).
"""

from collections.abc import Iterator
from typing import Annotated, Any

from flexlin.errors import Problem
from flexlin.mechanics.body import RigidMass
from flexlin.mechanics.effects.base import Effect, Scale, per_joint
from flexlin.precision import MINOR
from flexlin.scene.base import PerLink, Unit
from flexlin.scene.consistency import pinned
from flexlin.scene.effects import RawArm, RawTable


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
        return cls(inertia=scale.of_inertias(MINOR))

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
        return on_first(self.radius, joint)

    def joint_body(self, joint: int) -> RigidMass:
        return RigidMass(on_first(self.mass, joint), on_first(self.inertia, joint))


def on_first(value: Any, joint: int) -> Any:
    """Read a table's value for one joint; a single number stands for the first."""
    return per_joint(value if isinstance(value, tuple) else (value,), joint)
