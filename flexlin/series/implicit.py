"""From equations f(u, v) = 0 to the Taylor map of v(u)."""

from math import comb

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import real_array
from flexlin.errors import ArgumentError
from flexlin.series.engine import expand_implicit, seeded
from flexlin.series.explicit import check_analytic, check_symbols
from flexlin.series.expression import Expression
from flexlin.series.implicit_map import ImplicitMap
from flexlin.series.indices import indices
from flexlin.series.polynomial import Polynomial
from flexlin.series.recording import record_expressions
from flexlin.series.solution import closed
from flexlin.series.space import Numeric
from flexlin.symbolic import as_expression


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
