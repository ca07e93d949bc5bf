"""Closed loops as manipulators: an open arm reduced to independent coordinates with C_1 and C_2."""

from collections.abc import Sequence
from dataclasses import replace
from math import comb

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import real_array
from flexlin.errors import ModelError
from flexlin.kronecker.algebra import kron
from flexlin.kronecker.symbolic import derivative
from flexlin.mechanics.body import Frame, column
from flexlin.mechanics.coordinates import ClosedLoops, Parameters
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.manipulator import Manipulator
from flexlin.scene.links import BASE, Link, Loop
from flexlin.scene.scene import Scene
from flexlin.series.maps import implicit_taylor, solve_implicit

NEWTON_STEPS, FOLLOWING_STEPS = 4, 2
"""Steps of Newton's method at u, and at each place on the way there."""
MOST_INSTRUCTIONS, MOST_PLACES = 4000, 8
MOST_TERMS = 600
CLOSED_RESIDUAL = 1e-9
"""Largest |f| at which the loop counts as closed; beyond it the model answers nan instead of a wrong number."""


def close_loop(
    arm: Manipulator,
    closure: ca.SX,
    independent: Sequence[int],
    motors: Sequence[int],
    posture: ArrayLike,
    start: ca.SX | None = None,
) -> Manipulator:
    """Return a manipulator whose loops are closed, in independent coordinates u.

        f(u, v) = 0,   s' = K u',   s'' = K u'' + K' u',   K = [C_1; E],   K' u' = [C_2 (u' (x) u'); 0]
        M_u = K^T M K,   C_u = K^T (M K' + C K),   g_u = K^T g,   B_u = K^T B

    v(u) is the Taylor polynomial about the posture, refined by Newton steps; where these do not close the loop everything is nan.

    Assumes V = D_v f regular along the motion and what the motors move among the independent coordinates; passive joints bear no input.
    Parameters: closure f (nv, 1) of arm.s; independent: indices of u in s; motors: joints (columns of arm.B) that stay
    driven; posture: s near which the Taylor polynomial is made; it chooses the assembly; start: v(u) that nearly close the loops, from
    which Newton's steps go on instead.
    Raises: ModelError when numbers do not fit; ToleranceNotReached, SingularClosure when the posture cannot be closed.
    Source: de Jong et al. (2018), Eqs (14)-(25), corrected.
    """
    n, independent = arm.n, list(independent)
    dependent = [i for i in range(n) if i not in independent]
    if len(dependent) != closure.numel() or not {arm.drives[j] for j in motors} <= set(independent):
        raise ModelError(
            "independent coordinates do not fit the closure",
            got=independent,
            expected=f"{n - closure.numel()} indices, the motors' among them",
        )
    u, v = arm.s[independent], arm.s[dependent]
    u_dot, u_ddot = ca.SX.sym("u_dot", u.numel()), ca.SX.sym("u_ddot", u.numel())
    s = real_array("posture", posture, (n,))
    p = arm.parameters
    near = approximate(closure, u, v, s[independent], s[dependent], p) if start is None else start
    solution = refine(closure, u, v, near, p.symbols)
    K, K_dot = reduction(closure, u, v, u_dot, [*dependent, *independent])
    parts = {
        "residual": K.T @ arm.residual,
        "M": K.T @ arm.M @ K,
        "g": K.T @ arm.g,
        "damping": K.T @ arm.damping,
        "B": K.T @ arm.B[:, list(motors)],
        "coriolis": K.T @ (arm.M @ K_dot + arm.C @ K),
    }
    known = {name: getattr(arm, name) for name in ("energy", "points", "axes", "rotation")}
    parts |= {name: expression for name, expression in known.items() if expression is not None}
    moving = ca.substitute(list(parts.values()), [arm.s_dot, arm.s_ddot], [K @ u_dot, K @ u_ddot + K_dot @ u_dot])
    reduced = dict(zip(parts, map(ca.densify, ca.substitute(moving, [v], [solution])), strict=True))
    tip = None if arm.points is None else arm.points[:, -1]
    loops = ClosedLoops(solution, v, closure, moving[0], K[dependent, :], tip, arm.rotation)
    read = None if arm.measured is None else ca.densify(arm.measured[list(motors), independent])
    return replace(
        arm,
        s=u,
        s_dot=u_dot,
        s_ddot=u_ddot,
        reference=arm.reference[independent, list(motors)],
        drives=tuple(independent.index(arm.drives[j]) for j in motors),
        coordinates=tuple(arm.coordinates[i] for i in independent),
        measured=read,
        effects=None,
        loops=loops,
        **reduced,
    )


def reduction(f: ca.SX, u: ca.SX, v: ca.SX, u_dot: ca.SX, places: Sequence[int]) -> tuple[ca.SX, ca.SX]:
    """Return K and K' (n, nu) with s' = K u', s'' = K u'' + K' u', rows in the order of s; `places` of [v; u] in s.

        C_1 = -V^-1 U,   C_2 (E (x) u') = -V^-1 D_s [V, U] (K (x) K u')

    Source: de Jong et al., Eqs (16), (23), corrected, s = [v; u].
    """
    eye, s = ca.SX.eye(u.numel()), ca.vertcat(v, u)
    V, U = ca.jacobian(f, v), ca.jacobian(f, u)
    stacked = ca.vertcat(-ca.solve(V, U), eye)
    bend = -ca.solve(V, derivative(ca.horzcat(V, U), s) @ kron(stacked, stacked @ u_dot))
    K, K_dot = ca.SX(len(places), u.numel()), ca.SX(len(places), u.numel())
    K[list(places), :] = stacked
    K_dot[list(places[: v.numel()]), :] = bend
    return K, K_dot


def refine(f: ca.SX, u: ca.SX, v: ca.SX, near: ca.SX, p: ca.SX) -> ca.SX:
    """v(u) by Newton's steps from what is near it, nan where the loop stays open."""
    step = ca.Function("step", [u, v, p], [v - ca.solve(ca.jacobian(f, v), f)])
    gap = ca.Function("gap", [u, v, p], [ca.sumsqr(f)])
    for _ in range(NEWTON_STEPS):
        near = step(u, near, p)
    return ca.if_else(gap(u, near, p) < CLOSED_RESIDUAL**2, near, np.nan)


def approximate(f: ca.SX, u: ca.SX, v: ca.SX, u0: np.ndarray, guess: np.ndarray, parameters: Parameters) -> ca.SX:
    """Return v(u) as an expression: a Taylor polynomial, from which Newton's steps lead on.

    Equations of which a step is short are followed over several places on the way from the posture to u, so that u may lie far away.
    Coordinates that f does not hold are left out of the polynomial. It is made at the parameters' values; Newton's steps hold the
    symbols, so they find v for values nearby too.
    """
    p = parameters.symbols
    held = [i for i in range(u.numel()) if ca.depends_on(f, u[i])]
    within, start = u[held], u0[held]
    numbers = ca.substitute(f, p, ca.DM(parameters.values))
    v0 = solve_implicit(numbers, within, v, start, guess)
    order = choose_order(len(held), v.numel())
    taylor = implicit_taylor(numbers, within, v, start, v0, order).function()
    step = ca.Function("step", [within, v, p], [v - ca.solve(ca.jacobian(f, v), f)])
    places = min(max(MOST_INSTRUCTIONS // (FOLLOWING_STEPS * step.n_instructions()), 1), MOST_PLACES)
    way = shorten_turns(numbers, within, v, start, v0) / places
    solution = taylor(way)
    for place in range(1, places):
        for _ in range(FOLLOWING_STEPS):
            solution = step(start + place * way, solution, p)
    return solution


def shorten_turns(f: ca.SX, u: ca.SX, v: ca.SX, u0: np.ndarray, v0: np.ndarray) -> ca.SX:
    """u - u0, less the whole turns of angles that f does not notice: a crank that goes round is never more than half a turn away."""
    at, away = ca.Function("f", [u, v], [f]), ca.vertsplit(u - u0)
    here, turn = at(u0, v0), 2 * np.pi * np.eye(len(u0))
    same = [float(ca.norm_inf(at(u0 + turn[k], v0) - here)) < CLOSED_RESIDUAL for k in range(len(u0))]
    shortened = [
        ca.atan2(ca.sin(part), ca.cos(part)) if whole else part for part, whole in zip(away, same, strict=True)
    ]
    return ca.vertcat(*shortened)


def choose_order(nu: int, nv: int) -> int:
    """The highest order up to 4 whose polynomial of nv values by nu variables has few terms."""
    return max(k for k in range(1, 5) if k == 1 or nv * comb(nu + k, k) <= MOST_TERMS)


def close_scene_loops(arm: Manipulator, chain: Chain, scene: Scene, near: Manipulator | None = None) -> Manipulator:
    """The manipulator in the coordinates that are left when the passive joints follow from the closure of all loops.

        f(s) = [p_link - p_to - R_to x] = 0, one block a loop

    near: the same arm closed for small deflections, from which the passive joints follow further.
    Raises: ModelError when there are not as many passive joints as equations; what `close_loop` raises.
    """
    passive = [place for place, i in enumerate(chain.moving) if scene.links[i].passive]
    motors = [place for place in range(len(chain.moving)) if place not in passive]
    gap = join_tips(scene.loops, scene.links, chain.tips)
    if gap.numel() != len(passive):
        raise ModelError(
            "the passive joints do not fit the loops",
            got=f"{len(passive)} passive joints",
            expected=f"{gap.numel()}, one for each equation of closure (3 a loop, in a plane 2)",
            todo="set passive = true on the joints that the loops move, and on no others",
        )
    posture = np.zeros(arm.n)
    nominal = ca.Function(
        "posture", [arm.parameters.symbols], [ca.vertcat(*[scene.links[i].posture for i in chain.moving])]
    )
    posture[: len(chain.moving)] = nominal(arm.parameters.values).full()[:, 0]
    independent = [i for i in range(arm.n) if i not in passive]
    start = None
    if near is not None and near.loops is not None:
        known = ca.vertcat(near.s, near.parameters.symbols), ca.vertcat(arm.s[independent], arm.parameters.symbols)
        start = ca.substitute(near.loops.followers, *known)
    closed = close_loop(arm, gap, independent, motors, posture, start=start)
    return replace(closed, effects=arm.effects)


def join_tips(loops: Sequence[Loop], links: Sequence[Link], tips: Sequence[Frame]) -> ca.SX:
    """The closure equations f(s), in m: what stays zero whatever the coordinates are, as across a plane, is no equation."""
    names = [link.name for link in links]
    gaps = []
    for loop in loops:
        held, by = tips[names.index(loop.link)], Frame.fixed() if loop.to == BASE else tips[names.index(loop.to)]
        gaps.append(held.position - by.moved(column(*loop.point), ca.SX(3, 1)).position)
    gap = ca.sparsify(ca.vertcat(*gaps))
    return ca.densify(gap[gap.sparsity().row()])
