"""From equations f(u, v) = 0 to the Taylor map of v(u)."""

from math import comb
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, real_array
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
