"""Closed loops as manipulators: open arms side by side, reduced to independent coordinates with C_1 and C_2."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import real_array
from flexlin.errors import ModelError
from flexlin.kronecker import derivative, kron
from flexlin.mechanics.manipulator import Manipulator
from flexlin.series import implicit_taylor, solve_implicit

CLOSED = 1e-9
"""Largest |f| at which the loop counts as closed; beyond it the model answers nan instead of a wrong number."""


def side_by_side(first: Manipulator, second: Manipulator, names: tuple[str, str], points: ca.SX) -> Manipulator:
    """Return two manipulators as one, with coordinates s = [s_1; s_2] named after both; still unconnected.

    Parameters: points (2, k): where the second's points are, from base to tip. They come first,
    from tip to base, so the last point of all is the tip.
    """
    arms, shift = (first, second), first.n
    if first.energy is None or second.energy is None or first.parameters.paths or second.parameters.paths:
        raise ModelError("an arm lacks its energy or has free parameters", expected="arms built from links")

    def stacked(name: str) -> ca.SX:
        return ca.vertcat(*[getattr(arm, name) for arm in arms])

    def diagonal(name: str) -> ca.SX:
        return ca.diagcat(*[getattr(arm, name) for arm in arms])

    return Manipulator(
        stacked("s"),
        stacked("s_dot"),
        stacked("s_ddot"),
        residual=stacked("residual"),
        M=diagonal("M"),
        g=stacked("g"),
        damping=stacked("damping"),
        B=diagonal("B"),
        reference=diagonal("reference"),
        drives=(*first.drives, *(i + shift for i in second.drives)),
        coordinates=tuple(c.within(name) for name, arm in zip(names, arms, strict=True) for c in arm.coordinates),
        energy=first.energy + second.energy,
        points=ca.horzcat(points[:, ::-1], first.points),
        coriolis=diagonal("C"),
    )


def close_loop(
    arm: Manipulator,
    closure: ca.SX,
    independent: Sequence[int],
    motors: Sequence[int],
    posture: ArrayLike,
    order: int = 4,
) -> Manipulator:
    """Return a manipulator whose loops are closed, in independent coordinates u.

        f(u, v) = 0,   s' = K u',   s'' = K u'' + K' u',   K = [C_1; E],   K' u' = [C_2 (u' (x) u'); 0]
        M_u = K^T M K,   C_u = K^T (M K' + C K),   g_u = K^T g,   B_u = K^T B

    v(u) is the Taylor polynomial about the posture, refined by three Newton steps; where these do not close the loop everything is nan.

    Assumes V = D_v f regular along the motion and u's motors among the independent coordinates; passive joints bear no input.
    Parameters: closure f (nv, 1) of arm.s; independent: indices of u in s, motors first; motors: joints (columns of arm.B) that stay
    driven; posture: s near which the Taylor polynomial is made; it chooses the assembly.
    Raises: ModelError when numbers do not fit; ToleranceNotReached, SingularClosure when the posture cannot be closed.
    Source: de Jong et al. (2018), Eqs (14)-(25), corrected.
    """
    n, dependent = arm.n, [i for i in range(arm.n) if i not in set(independent)]
    if len(dependent) != closure.numel() or [arm.drives[j] for j in motors] != list(independent[: len(motors)]):
        raise ModelError(
            "independent coordinates do not fit the closure", got=list(independent), expected="motors first"
        )
    u, v = arm.s[list(independent)], arm.s[dependent]
    u_dot, u_ddot = ca.SX.sym("u_dot", u.numel()), ca.SX.sym("u_ddot", u.numel())
    s = real_array("posture", posture, (n,))
    solution = implicit_solution(closure, u, v, s[list(independent)], s[dependent], order)
    K, K_dot = reduction(closure, u, v, u_dot, [*dependent, *independent])
    parts = {
        "residual": K.T @ arm.residual,
        "M": K.T @ arm.M @ K,
        "g": K.T @ arm.g,
        "damping": K.T @ arm.damping,
        "B": K.T @ arm.B[:, list(motors)],
        "energy": arm.energy,
        "points": arm.points,
        **({} if arm.axes is None else {"axes": arm.axes}),
        "coriolis": K.T @ (arm.M @ K_dot + arm.C @ K),
    }
    moving = ca.substitute(list(parts.values()), [arm.s_dot, arm.s_ddot], [K @ u_dot, K @ u_ddot + K_dot @ u_dot])
    reduced = ca.substitute(moving, [v], [solution])
    return replace(
        arm,
        s=u,
        s_dot=u_dot,
        s_ddot=u_ddot,
        reference=ca.DM.eye(u.numel())[:, : len(motors)],
        drives=tuple(range(len(motors))),
        coordinates=tuple(arm.coordinates[i] for i in independent),
        measured=None,
        effects=None,
        **{name: ca.densify(value) for name, value in zip(parts, reduced, strict=True)},
    )


def reduction(f: ca.SX, u: ca.SX, v: ca.SX, u_dot: ca.SX, places: Sequence[int]) -> tuple[ca.SX, ca.SX]:
    """Return K and K' (n, nu) with s' = K u', s'' = K u'' + K' u', rows in the order of s; `places` of [v; u] in s."""
    C1, C2 = closure_jacobians(f, u, v)
    eye, K, K_dot = ca.SX.eye(u.numel()), ca.SX(len(places), u.numel()), ca.SX(len(places), u.numel())
    K[list(places), :] = ca.vertcat(C1, eye)
    K_dot[list(places[: v.numel()]), :] = C2 @ kron(eye, u_dot)
    return K, K_dot


def implicit_solution(f: ca.SX, u: ca.SX, v: ca.SX, u0: np.ndarray, guess: np.ndarray, order: int) -> ca.SX:
    """Return v(u) as an expression: Taylor polynomial, three Newton steps, nan where the loop stays open."""
    v0 = solve_implicit(f, u, v, u0, guess)
    taylor = implicit_taylor(f, u, v, u0, v0, order).function()
    step = ca.Function("step", [u, v], [v - ca.solve(ca.jacobian(f, v), f)])
    gap = ca.Function("gap", [u, v], [ca.sumsqr(f)])
    solution = taylor(u - u0)
    for _ in range(3):
        solution = step(u, solution)
    return ca.if_else(gap(u, solution) < CLOSED**2, solution, np.nan)


def closure_jacobians(f: ca.SX, u: ca.SX, v: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return C_1 (nv, nu) and C_2 (nv, nu^2) as expressions: de Jong et al., Eqs (16), (23), corrected, s = [v; u]."""
    s = ca.vertcat(v, u)
    V, U = ca.jacobian(f, v), ca.jacobian(f, u)
    C1 = -ca.solve(V, U)
    K = ca.vertcat(C1, ca.SX.eye(u.numel()))
    return C1, -ca.solve(V, derivative(ca.horzcat(V, U), s) @ kron(K, K))
