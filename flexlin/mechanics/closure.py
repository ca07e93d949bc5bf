"""Closed loops of screws: the closure equations and all their derivatives without differentiation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import SUM_ROUNDING, Array, real_array
from flexlin.errors import ArgumentError, SingularClosure
from flexlin.kronecker.expansion import closure_jacobians, refuse_if_large
from flexlin.mechanics.screws import OpenChain, revolute
from flexlin.series.implicit import ImplicitMap, implicit_taylor, solve_implicit


@dataclass(frozen=True)
class Branch:
    """A weighted point of a chain, W H(s_joints) x.

    Parameters: chain; joints: for each joint of the chain its index in s; point x (3,) in the last body (m);
    weight W (m, 3): how the point's coordinates enter the m closure equations.
    """

    chain: OpenChain
    joints: tuple[int, ...]
    point: Array
    weight: Array

    def derivative(self, s: Array, k: int) -> Array:
        """Return all k-th partial derivatives by the chain's own joints, (m, joints, ..., joints)."""
        q = s[list(self.joints)]

        @cache
        def partial(alpha: tuple[int, ...]) -> Array:
            return self.weight @ (self.chain.partial(q, alpha) @ np.append(self.point, 1.0))[:3]

        joints = self.chain.n
        tensor = np.empty((len(self.weight), *[joints] * k))
        for index in np.ndindex(*[joints] * k):
            tensor[(slice(None), *index)] = partial(tuple(np.bincount(index, minlength=joints) if k else [0] * joints))
        return tensor


@dataclass(frozen=True)
class Closure:
    """Closure equations that join points of open chains.

        f(s) = E s + e + sum_b W_b H_b(s_b) x_b = 0

    Assumes as many equations as dependent coordinates.

    Parameters: branches; linear E (m, n), for coordinates that are themselves a position; constant e (m,).
    Source: de Jong et al., Eqs (26), (27), with the sign and the rows of (27) corrected.
    """

    branches: tuple[Branch, ...]
    linear: Array
    constant: Array

    def derivative(self, s: ArrayLike, k: int) -> Array:
        """Return D_s^k f (m, n^k) in Kronecker layout; k = 0 gives f itself (m, 1)."""
        m, n = self.linear.shape
        s = real_array("s", s, (n,))
        tensor = np.zeros((m, *[n] * k))
        if k < 2:
            tensor += self.linear if k else self.linear @ s + self.constant
        for branch in self.branches:
            tensor[np.ix_(range(m), *[branch.joints] * k)] += branch.derivative(s, k)
        return tensor.reshape(m, -1)

    def expression(self, s: Any) -> Any:
        """Return f as a CasADi column (m, 1) of a CasADi column s (n, 1)."""
        f = self.linear @ s + self.constant
        for branch in self.branches:
            tip = branch.chain.expression([s[i] for i in branch.joints], np.append(branch.point, 1.0)[:, None])
            f = f + branch.weight @ tip[:3]
        return f

    def equations(self, independent: Sequence[int]) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Return f, u, v as CasADi columns: the closure as `implicit_taylor` takes it."""
        n, dependent = self.linear.shape[1], self.dependent(independent)
        u, v = ca.SX.sym("u", len(independent)), ca.SX.sym("v", len(dependent))
        s = ca.SX(n, 1)
        s[list(independent)], s[dependent] = u, v
        return self.expression(s), u, v

    def taylor(self, s: ArrayLike, independent: Sequence[int], order: int) -> ImplicitMap:
        """Return the Taylor map of the dependent by the independent coordinates about s: `implicit_taylor` on this closure."""
        at = real_array("s", s, (self.linear.shape[1],))
        f, u, v = self.equations(independent)
        return implicit_taylor(f, u, v, at[list(independent)], at[self.dependent(independent)], order)

    def close(self, s: ArrayLike, independent: Sequence[int]) -> Array:
        """Return s with its dependent coordinates moved by Newton's method until f(s) = 0.

        Raises: as `solve_implicit`; SingularClosure when V is singular at the start.
        """
        s = real_array("s", s, (self.linear.shape[1],)).copy()
        dependent, (f, u, v) = self.dependent(independent), self.equations(independent)
        self.checked_V(s, dependent)
        s[dependent] = solve_implicit(f, u, v, s[list(independent)], s[dependent])
        return s

    def jacobians(self, s: ArrayLike, independent: Sequence[int], order: int) -> list[Array]:
        """Return C_1 ... C_order of the dependent by the independent coordinates, from screw derivatives alone.

        Parameters: s (n,): a configuration with f(s) = 0; independent: indices of u in s, the others are v, both in the order of s.
        Returns: C_k (nv, nu^k).
        Raises: ArgumentError when the loop is open at s or the numbers do not fit; SingularClosure when V is singular;
        TooLarge with the bytes.
        Source: de Jong et al., Eqs (14)-(27), corrected.
        """
        m, n = self.linear.shape
        dependent = self.dependent(independent)
        gap = float(np.abs(self.derivative(s, 0)).max())
        if gap > 1e-9:
            raise ArgumentError("the loop is open at s", got=f"|f| = {gap:.3g}", todo="close it: closure.close(s, u)")
        self.checked_V(real_array("s", s, (n,)), dependent)
        refuse_if_large(order, m, n - m)
        sequence = [*dependent, *independent]
        derivatives = [
            self.derivative(s, k).reshape(m, *[n] * k)[np.ix_(range(m), *[sequence] * k)].reshape(m, -1)
            for k in range(1, order + 1)
        ]
        return closure_jacobians(derivatives, m)

    def dependent(self, independent: Sequence[int]) -> list[int]:
        """Return the indices of v, those of s that are not independent."""
        m, n = self.linear.shape
        dependent = [i for i in range(n) if i not in set(independent)]
        if len(dependent) != m or len(independent) != n - m:
            raise ArgumentError(
                "independent coordinates do not fit", got=list(independent), expected=f"{n - m} indices"
            )
        return dependent

    def checked_V(self, s: Array, dependent: Sequence[int]) -> Array:
        """Return V = D_v f, refusing a singular one."""
        V = self.derivative(s, 1)[:, dependent]
        if np.linalg.cond(V) > 1 / SUM_ROUNDING:
            raise SingularClosure("V is singular", got=f"s = {s.tolist()}", todo="choose other independent coordinates")
        return V


_, Y, Z = np.eye(3)


def planar_arm(base: ArrayLike, lengths: ArrayLike) -> tuple[OpenChain, Array]:
    """Return a planar chain of hinges with relative angles, stretched along x at zero, and the position of its tip (3,)."""
    base, lengths = real_array("base", base, (2,)), real_array("lengths", lengths, (None,))
    x = base[0] + np.concatenate([[0.0], np.cumsum(lengths)])
    chain = OpenChain([revolute(Z, (xi, base[1], 0.0)) for xi in x[:-1]])
    return chain, np.array([x[-1], base[1], 0.0])


def five_bar(base: float, left: Sequence[float], right: Sequence[float]) -> Closure:
    """Return a planar 5-bar in s = [q1, q2, q3, q4, x, y]: two arms whose tips are the end effector.

        f = [x - x_a(q1, q2); x - x_b(q3, q4)]

    With u = (x, y) it gives the inverse kinematics, with u = (q1, q3) the forward kinematics.

    Parameters: base: distance of the right arm's hinge from the left one, along x (m); left, right: proximal and distal length (m).
    Source: de Jong et al., Eq (26); angles relative.
    """
    branches = []
    for i, (origin, lengths) in enumerate((((0.0, 0.0), left), ((base, 0.0), right))):
        chain, tip = planar_arm(origin, lengths)
        weight = np.zeros((4, 3))
        weight[2 * i : 2 * i + 2, :2] = -np.eye(2)
        branches.append(Branch(chain, (2 * i, 2 * i + 1), tip, weight))
    linear = np.hstack([np.zeros((4, 4)), np.vstack([np.eye(2), np.eye(2)])])
    return Closure(tuple(branches), linear, np.zeros(4))


def four_bar(base: float, crank: float, coupler: float, rocker: float) -> Closure:
    """Return a planar 4-bar in s = [crank angle, coupler angle relative to the crank, rocker angle]; lengths in m."""
    arm, tip = planar_arm((0.0, 0.0), (crank, coupler))
    other, end = planar_arm((base, 0.0), (rocker,))
    plane = np.eye(2, 3)
    return Closure((Branch(arm, (0, 1), tip, plane), Branch(other, (2,), end, -plane)), np.zeros((2, 3)), np.zeros(2))


def rssr(crank: float, coupler: float, rocker: float, base: ArrayLike, axis: ArrayLike) -> Closure:
    """Return a spatial RSSR loop in s = [crank, two angles of the first ball joint, rocker].

    The crank turns about z through the origin, the rocker about `axis` through `base`; the coupler's spin about itself is left out.

    Parameters: lengths in m; base (3,), axis (3,).
    """
    base = real_array("base", base, (3,))
    ball = (crank, 0.0, 0.0)
    arm = OpenChain([revolute(Z, (0, 0, 0)), revolute(Z, ball), revolute(Y, ball)])
    across = np.cross(real_array("axis", axis, (3,)), Z)
    end = base + rocker * across / np.linalg.norm(across)
    space = np.eye(3)
    branches = (
        Branch(arm, (0, 1, 2), np.array([crank + coupler, 0.0, 0.0]), space),
        Branch(OpenChain([revolute(axis, base)]), (3,), end, -space),
    )
    return Closure(branches, np.zeros((3, 4)), np.zeros(3))
