"""From equations f(u, v) = 0 to the Taylor map of v(u), and solutions of F(z, t) = 0 followed in time."""

from collections.abc import Callable
from math import comb
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import ROUNDING, Array, real_array
from flexlin.errors import ArgumentError, SingularClosure, ToleranceNotReached
from flexlin.series.engine import Tape, expand_implicit, record_expressions, seeded
from flexlin.series.explicit import Expression, check_analytic, check_symbols
from flexlin.series.folds import closure_and_jacobian, find_fold, newton
from flexlin.series.implicit_map import ImplicitMap
from flexlin.series.indices import Polynomial, indices
from flexlin.series.space import Numeric
from flexlin.symbolic import as_expression

SINGULAR = 1e-10
"""V with a reciprocal condition number below this is called singular."""
CLOSED = 1e-3
"""Newton's first step, relative to |v0|, up to which a point counts as a solution given with few digits."""
Step = Callable[[float, Array], Array]
"""Time and place to Newton's step F_z^-1 F."""
NEWTON, CONTRACTION = 8, 16
"""Newton's steps at each time, and how much shorter each must be than the one before."""
SHORTEST = 1e-10
"""Of a period, the shortest step, and how exactly a time is found."""
SUSPECT = 0.05
"""A reciprocal condition number below which it is looked at closer where it is least."""
GOLDEN, SECTIONS = (np.sqrt(5.0) - 1) / 2, 40


def solve_implicit(f: Any, u: Any, v: Any, u0: ArrayLike, guess: ArrayLike) -> Array:
    """Solve f(u0, v) = 0 for v by Newton's method from a guess.

    Parameters
    ----------
    f : casadi.SX or casadi.MX, shape (nv, 1)
        The equations, expressions of u and v only.
    u : casadi.SX or casadi.MX, shape (nu, 1)
        Symbols of the independent coordinates.
    v : casadi.SX or casadi.MX, shape (nv, 1)
        Symbols of the dependent coordinates.
    u0 : array_like, shape (nu,)
        The independent coordinates.
    guess : array_like, shape (nv,)
        Where to start.

    Returns
    -------
    array, shape (nv,)
        v, to rounding.

    Raises
    ------
    ToleranceNotReached
        When 50 steps from this guess do not reach a solution.

    Examples
    --------
    >>> import casadi as ca
    >>> from flexlin.series import solve_implicit
    >>> u, v = ca.SX.sym("u"), ca.SX.sym("v")
    >>> solve_implicit(v**3 + v - u, u, v, [2.0], [0.5]).round(12).tolist()
    [1.0]
    """
    point, start = real_array("u0", u0, (u.numel(),)), real_array("guess", guess, (v.numel(),))
    solution, last = newton(record_expressions("f", [ca.vec(f)], [u, v]), point[None, :], start[None, :], 50)
    if not last[0] < 1e-9 * (1 + np.abs(solution[0]).max()):
        raise ToleranceNotReached(
            "f(u0, v) = 0 has no solution that Newton's method reaches",
            got=f"guess {start.tolist()} at u0 = {point.tolist()}",
            todo="start nearer to a solution, or move u0 inside the workspace",
        )
    return solution[0]


def closed(tape: Tape, u0: Array, v0: Array) -> Array:
    """Return v0 refined to rounding, refusing a point that is no solution or singular."""
    f, V = closure_and_jacobian(tape, u0[None, :], v0[None, :])
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(V))):
        check_analytic(np.array(np.nan), "(u0, v0)", np.concatenate([u0, v0]))
    if np.linalg.cond(V[0]) > 1 / SINGULAR:
        raise singular_closure(tape, u0, v0)
    v, last = newton(tape, u0[None, :], v0[None, :])
    moved = np.abs(v[0] - v0).max()
    if not (last[0] < 1e-9 and moved < CLOSED * (1 + np.abs(v0).max())):
        raise ArgumentError(
            "the point does not solve f(u, v) = 0",
            got=f"|f| = {np.abs(f).max():.3g}, v0 {moved:.3g} away from a solution",
            todo="solve for v0 first",
        )
    return v[0]


def singular_closure(tape: Tape, u0: Array, v0: Array) -> SingularClosure:
    """Return the error that names the singular configuration nearest to a point."""
    fold = find_fold(tape, u0, np.eye(len(u0)), (np.zeros(len(u0)), v0))
    where = (
        f"u = {(u0 + fold.t).tolist()}, v = {fold.v.tolist()}"
        if fold.defect < 1e-6
        else "no fold was confirmed near by"
    )
    return SingularClosure(
        "V = D_v f is singular at the point of evaluation",
        got=f"u0 = {u0.tolist()}; closest singular configuration: {where}; there v can move along {np.round(fold.phi, 6).tolist()}",
        todo="move u0 away from it, or choose other independent coordinates",
    )


@checked
def implicit_taylor(
    f: Expression, u: Expression, v: Expression, u0: ArrayLike, v0: ArrayLike, order: int
) -> ImplicitMap:
    """Expand the solution v(u) of f(u, v) = 0 about a point.

        v(u0 + du) ~ v0 + sum_(k=1..order) 1/k! C_k du^(x)k

    by truncated power series, order by order; symmetric derivatives are computed and stored once.
    Assumes f analytic, as many equations as dependent coordinates, V = D_v f regular at the point. A v0 given with few digits is refined.

    Parameters
    ----------
    f : casadi.SX or casadi.MX, shape (nv, 1)
        The equations, expressions of u and v only.
    u : casadi.SX or casadi.MX, shape (nu, 1)
        Symbols of the independent coordinates.
    v : casadi.SX or casadi.MX, shape (nv, 1)
        Symbols of the dependent coordinates.
    u0 : array_like, shape (nu,)
        Where to expand.
    v0 : array_like, shape (nv,)
        A solution there.
    order : int
        The highest degree, from 0 on.

    Returns
    -------
    ImplicitMap
        c: c(du), c.jacobian(k), c.error(du), c.radius(direction), c.linear_range(tol, direction), c.function().

    Raises
    ------
    ArgumentError
        On shapes, symbols, or a point that does not solve f = 0.
    SingularClosure
        Where V is singular.
    TooLarge
        When the coefficients would not fit into memory; the message gives the bytes.

    References
    ----------
    de Jong, Müller, van Dijk, Herder (2018), Eqs (14)-(25), corrected.

    Examples
    --------
    v^3 + v = u near u = 2, v = 1, where v' = 1/4:

    >>> import casadi as ca
    >>> import flexlin as fl
    >>> u, v = ca.SX.sym("u"), ca.SX.sym("v")
    >>> c = fl.implicit_taylor(v**3 + v - u, u, v, [2.0], [1.0], 5)
    >>> c.jacobian(1).item()
    0.25
    >>> print(f"{c([0.2]).item():.6f} {c.refined([0.2]).item():.6f}")
    1.048228 1.048228
    """
    check_symbols("u", u)
    check_symbols("v", v)
    f = ca.vec(f if isinstance(f, ca.MX) else as_expression("f", f))
    if f.numel() != v.numel():
        raise ArgumentError(
            "equations and dependent coordinates differ", got=(f.numel(), v.numel()), expected="as many"
        )
    point, guess = real_array("u0", u0, (u.numel(),)), real_array("v0", v0, (v.numel(),))
    tape = record_expressions("f", [f], [u, v])
    table = indices(len(point), order, 8 * tape.size * comb(len(point) + max(order, 0), len(point)))
    solution = closed(tape, point, guess)
    space = Numeric(table)
    series = expand_implicit(tape, space, seeded(space, point, np.eye(len(point))), solution)
    coefficients = np.array(series).T
    check_analytic(coefficients, "(u0, v0)", np.concatenate([point, solution]))
    return ImplicitMap(tape, Polynomial(table, coefficients), point, solution)


def newton_from(step: Step, t: float, z: Array) -> Array | None:
    """z with F(z, t) = 0, by steps that shrink fast from the first one on; None where they do not."""
    last = np.inf
    for _ in range(NEWTON):
        change = step(t, z)
        size = float(np.abs(change).max(initial=0.0))
        if not size < max(last / CONTRACTION, ROUNDING):
            return None
        z, last = z - change, size
        if size < ROUNDING * (1 + float(np.abs(z).max(initial=0.0))):
            return z
    return None


def track(step: Step, z: Array, a: float, b: float, shortest: float) -> tuple[Array | None, float]:
    """The solution at time b from the one at a, over steps that are halved where Newton's method fails, and doubled where not.

    Returns: the solution, or None where no step leads on, and the time that was reached.
    """
    width, at = b - a, a
    while at < b:
        there = min(at + width, b)
        found = newton_from(step, there, z)
        if found is not None:
            z, at, width = found, there, 2 * width
        elif width < shortest:
            return None, at
        else:
            width /= 2
    return z, at


def worth(V: Array) -> float:
    """The reciprocal condition number."""
    values = np.linalg.svd(V, compute_uv=False)
    return float(values[-1] / values[0]) if values.size and values[0] else 0.0


def find_turn(side: Callable[[float], float], a: float, b: float, width: float) -> float:
    """The time in (a, b], within `width`, from which on a sign is another one than at a."""
    before, lower, upper = side(a), a, b
    while upper - lower > width:
        middle = (lower + upper) / 2
        lower, upper = (lower, middle) if side(middle) != before else (middle, upper)
    return upper


def find_lowest(value: Callable[[float], float], a: float, b: float) -> tuple[float, float]:
    """Where between a and b a function is least, and its value there, by golden sections."""
    c, d = b - (b - a) * GOLDEN, a + (b - a) * GOLDEN
    at_c, at_d = value(c), value(d)
    for _ in range(SECTIONS):
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - (b - a) * GOLDEN
            at_c = value(c)
        else:
            a, c, at_c = c, d, at_d
            d = a + (b - a) * GOLDEN
            at_d = value(d)
    return (c, at_c) if at_c < at_d else (d, at_d)
