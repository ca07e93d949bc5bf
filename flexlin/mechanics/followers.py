"""What a manipulator with closed loops knows of the joints that follow."""

from dataclasses import dataclass

import casadi as ca

from flexlin.expressions import Expressions


@dataclass(frozen=True, eq=False)
class ClosedLoops(Expressions):
    """The joints v(u) (k, 1) that follow from f(u, v) = 0; nan where a loop stays open.

    With symbols v (k, 1) in the place of v(u): f (k, 1), the residual (n, 1), C_1 = D_u v (k, n), the tip's position (2 or 3, 1) and
    the rotation of its axes (3, 3), where these are known.
    """

    followers: ca.SX
    v: ca.SX
    gap: ca.SX
    residual: ca.SX
    slopes: ca.SX
    tip: ca.SX | None = None
    rotation: ca.SX | None = None

    def slope(self, s: ca.SX) -> ca.SX:
        """The residual's Jacobian by s, (n, n), with the symbols v: by the chain rule far shorter than through the steps that find v(u)."""
        return ca.jacobian(self.residual, s) + ca.jacobian(self.residual, self.v) @ self.slopes

    def newton_step(self) -> ca.SX:
        """V^-1 f (k, 1), V = D_v f, by u and the symbols v."""
        return ca.solve(ca.jacobian(self.gap, self.v), self.gap)
