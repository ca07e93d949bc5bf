"""Hub: T = 1/2 m v^2 + 1/2 J1 q'^2 of a rigid body on each joint; its radius moves the link out, x -> x + r.

Source: Khang, Dat, Tuan (2019), Eq. (68) (J1).
"""

from typing import Any

from flexlin.mechanics.body import Body, rigid_body
from flexlin.mechanics.effects.base import Chain, Effect, per_joint


class Hub(Effect):
    """A rigid body that turns with each link about its joint."""

    def joint_radius(self, joint: int) -> Any:
        return per_joint(self.table.radius, joint, single="first")

    def bodies(self, chain: Chain) -> tuple[Body, ...]:
        return tuple(
            rigid_body(
                frame,
                per_joint(self.table.mass, joint, single="first"),
                per_joint(self.table.inertia, joint, single="first"),
            )
            for joint, frame in enumerate(chain.joints)
        )
