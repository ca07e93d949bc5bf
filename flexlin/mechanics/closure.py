"""Closed loops f(s) = 0 as CasADi expressions, with any choice of independent coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.series.maps import ImplicitMap, implicit_taylor, solve_implicit


@dataclass(frozen=True, eq=False)
class Closure:
    """Closure equations f(s) = 0 (m, 1) in all coordinates s (n, 1) of a loop, of which n - m are independent."""

    gap: ca.SX
    s: ca.SX

    def equations(self, independent: Sequence[int]) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return f, u, v: the closure as `implicit_taylor` takes it."""
        return self.gap, self.s[list(independent)], self.s[self.dependent(independent)]

    def taylor(self, s: ArrayLike, independent: Sequence[int], order: int) -> ImplicitMap:
        """Return the Taylor map of the dependent by the independent coordinates about s: `implicit_taylor` on this closure."""
        at = real_array("s", s, (self.s.numel(),))
        f, u, v = self.equations(independent)
        return implicit_taylor(f, u, v, at[list(independent)], at[self.dependent(independent)], order)

    def close(self, s: ArrayLike, independent: Sequence[int]) -> Array:
        """Return s with its dependent coordinates moved by Newton's method until f(s) = 0."""
        s = real_array("s", s, (self.s.numel(),)).copy()
        dependent, (f, u, v) = self.dependent(independent), self.equations(independent)
        s[dependent] = solve_implicit(f, u, v, s[list(independent)], s[dependent])
        return s

    def dependent(self, independent: Sequence[int]) -> list[int]:
        """Return the indices of v, those of s that are not independent."""
        m, n = self.gap.numel(), self.s.numel()
        dependent = [i for i in range(n) if i not in set(independent)]
        if len(dependent) != m or len(independent) != n - m:
            expected = f"{n - m} indices"
            raise ArgumentError("independent coordinates do not fit", got=list(independent), expected=expected)
        return dependent


def five_bar(base: float, left: Sequence[float], right: Sequence[float]) -> Closure:
    """Return a planar 5-bar in s = [q1, q2, q3, q4, x, y]: two arms whose tips are the end effector.

        f = [x - x_a(q1, q2); x - x_b(q3, q4)]

    With u = (x, y) it gives the inverse kinematics, with u = (q1, q3) the forward kinematics.

    Parameters: base: distance of the right arm's hinge from the left one, along x (m); left, right: proximal and distal length (m).
    Source: de Jong et al., Eq (26); angles relative.
    """
    s = ca.SX.sym("s", 6)
    tips = []
    for origin, (first, second), (turn, bend) in ((0.0, left, (s[0], s[1])), (base, right, (s[2], s[3]))):
        x = origin + first * ca.cos(turn) + second * ca.cos(turn + bend)
        tips.append(ca.vertcat(x, first * ca.sin(turn) + second * ca.sin(turn + bend)))
    return Closure(ca.vertcat(*(s[4:] - tip for tip in tips)), s)
