"""Equations f(u, v) = 0 with V = D_v f as programs, and the power series of their solution v(u)."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.program import Program
from flexlin.series.jets import Jet, Space, carry_out, scalar_function


@dataclass(frozen=True, eq=False)
class Equations:
    """f(u, v), with as many rows as v, and V = D_v f, column by column."""

    gap: Program
    slope: Program

    @classmethod
    def read(cls, f: Any, u: Any, v: Any) -> Self:
        """Those of CasADi expressions (SX or MX). Raises: ArgumentError where f has free symbols."""
        function = scalar_function("f", [ca.vec(f)], [u, v])
        inputs = function.sx_in()
        V = ca.vec(ca.densify(ca.jacobian(function.call(inputs)[0], inputs[1])))
        return cls(Program.read(function), Program.read(ca.Function("V", inputs, [V])))

    def slopes(self, u: list[Jet], v: list[Jet]) -> list[list[Jet]]:
        """V as series, row by row."""
        (jets,) = carry_out(self.slope, u, v)
        rows = int(self.gap.sizes[0])
        return [jets[i::rows] for i in range(rows)]

    def at(self, u: Array, v: Array) -> tuple[Array, Array]:
        """f (N, m) and V (N, m, m) at u (N, nu), v (N, nv)."""
        space = Space(1, 0, (len(u),), np.result_type(u, v))
        given = [[Jet(space, (), column[None]) for column in x.T] for x in (u, v)]
        f = np.array([jet.c[0] for jet in carry_out(self.gap, *given)[0]]).T
        V = np.array([[jet.c[0] for jet in row] for row in self.slopes(*given)])
        return f, np.moveaxis(V, 2, 0)

    @np.errstate(all="ignore")
    def expand(self, space: Space, u: Callable[[Space], list[Jet]], v0: Array) -> Array:
        """The coefficients (nv, size, ...) of v(u) from its value (nv, ...), where f = 0 and V is regular.

            V dv = -f(u, v),   v right up to the degree r, dv from r + 1 to 2r + 1

        Parameters: u: gives the independent coordinates as series of a space, which is this one with lower orders.
        Source: the equations of de Jong et al. (14)-(25), by Newton's method on series instead of by Kronecker products.
        """
        v, r = np.array([space.zeros(space.all) for _ in v0]), 0
        v[:, 0] = v0
        while r < space.order:
            near, far = (
                replace(space, order=order) for order in (min(r, space.order - r - 1), min(2 * r + 1, space.order))
            )
            V = self.slopes(u(near), [near.fit(one) for one in v])
            (f,) = carry_out(self.gap, u(far), [far.fit(one) for one in v])
            step = solve_linear(far, V, [jet.whole for jet in f], r + 1)
            v[:, : step.shape[1]] += step
            r = far.order
        return v


def solve_linear(space: Space, V: list[list[Jet]], f: list[Array], first: int) -> Array:
    """x (nv, size, ...) of V x = -f from the degree `first` on, in which f begins.

    V_0 x_k = -f_k - sum_(j > 0) V_j x_(k-j)
    """
    indices = space.indices(space.all)
    x = np.array([space.zeros(space.all) for _ in V])
    head = np.array([[jet.c[0] for jet in row] for row in V])
    moving = [[(i, space.fit(jet.whole).c) for i, jet in enumerate(row) if jet.variables] for row in V]
    for k in range(first, space.order + 1):
        where = indices.degree(k)
        right = np.array([-one[where] for one in f])
        for one, row in zip(right, moving, strict=True):
            for i, c in row if k > first else ():
                one -= space.convolve(indices, c, x[i], k)
        x[:, where] = space.solve(head, right)
    return x
