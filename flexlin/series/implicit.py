"""From equations f(u, v) = 0 to the Taylor map of v(u), which knows how far it may be trusted."""

from math import comb
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError, SingularClosure, ToleranceNotReached
from flexlin.lazy import lazy
from flexlin.precision import FAINT, SLIGHT
from flexlin.series.equations import Equations, Radius, find_fold, line_series, newton, newton_step, radius_along
from flexlin.series.explicit import Expression, check_analytic, check_symbols
from flexlin.series.indices import Polynomial, indices
from flexlin.series.jets import Jet, Space, Symbolic
from flexlin.summary import immutable
from flexlin.symbolic import as_expression


def unrolled(equations: Equations, order: int, nu: int, nv: int) -> ca.Function:
    """Return (u0, v0, du) -> v, the Taylor polynomial about any solution (u0, v0), without loops, branches or linear solvers.

    It is the series of v(u0 + t du) by powers of t, summed at t = 1.
    """
    u0, v0, du = (ca.SX.sym(name, size) for name, size in (("u0", nu), ("v0", nv), ("du", nu)))
    series = line_series(equations, Symbolic(1, order), *(ca.vertsplit(symbol) for symbol in (u0, v0, du)))
    v = ca.vertcat(*[sum(column, ca.SX(0)) for column in series.T])
    return ca.Function("taylor", [u0, v0, du], [ca.densify(ca.cse(v))], ["u0", "v0", "du"], ["v"])


def c_code(function: ca.Function) -> str:
    """Return self-contained C source of a CasADi function.

    Parameters
    ----------
    function : casadi.Function
        Such as `TaylorMap.function()` or `ImplicitMap.moving`.

    Returns
    -------
    str
        C99 source.

    Raises
    ------
    ArgumentError
        When a C compiler could not use it, because the function calls external code.

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> from flexlin.series import c_code
    >>> x = ca.SX.sym("x")
    >>> source = c_code(fl.taylor(ca.sin(x), x, [0.0], 3).function())
    >>> "taylor" in source
    True
    """
    try:
        generator = ca.CodeGenerator(f"{function.name()}.c")
        generator.add(function)
        return generator.dump()
    except RuntimeError as error:
        raise ArgumentError("no C code for this function", got=str(error)[-200:]) from None


@immutable
class ImplicitMap:
    """The Taylor polynomial of an implicit function v(u), f(u, v) = 0, about a point.

    Call it with du (nu,) to get v (nv,) at u0 + du, or with du (N, nu) to get (N, nv).

    Attributes
    ----------
    equations : Equations
        f and D_v f.
    polynomial : Polynomial
        The coefficients, each monomial stored once.
    u0 : array, shape (nu,)
        Independent coordinates of the point.
    v0 : array, shape (nv,)
        Dependent coordinates of the point.

    Examples
    --------
    The circle u^2 + v^2 = 1 from its top:

    >>> import casadi as ca
    >>> import flexlin as fl
    >>> u, v = ca.SX.sym("u"), ca.SX.sym("v")
    >>> c = fl.implicit_taylor(u**2 + v**2 - 1, u, v, [0.0], [1.0], 6)
    >>> print(f"{c([0.6]).item():.4f} {c.refined([0.6]).item():.4f} {c.error([0.6]):.1e}")
    0.8009 0.8000 8.8e-04
    >>> print(f"{c.radius([1.0]):.4f} {c.linear_range(1e-3, [1.0]):.4f}")
    1.0000 0.0447
    """

    equations: Equations
    polynomial: Polynomial
    u0: Array
    v0: Array

    @property
    def order(self) -> int:
        """The highest degree."""
        return self.polynomial.indices.order

    def __call__(self, du: ArrayLike) -> Array:
        """Return v (nv,) at u0 + du, du (nu,); or (N, nv) for du (N, nu)."""
        return self.polynomial(du)

    def jacobian(self, k: int) -> Array:
        """Return a derivative of v by u in Kronecker layout, i_k fastest.

        Parameters
        ----------
        k : int
            Its order, at most that of the map.

        Returns
        -------
        array, shape (nv, nu^k)
            C_k = D_u^k v.

        Raises
        ------
        ArgumentError
            For an order that is not known.
        TooLarge
            When the layout would not fit into memory.

        References
        ----------
        de Jong, Müller, van Dijk, Herder (2018), Eqs (16)-(24).
        """
        return self.polynomial.kronecker(k)

    def error(self, du: ArrayLike) -> Any:
        """Return the estimated error of the polynomial, |V^-1 f(u, v)|: the length of one Newton step from its value.

        Within a few percent of the true error while that is small; infinite where V is singular.

        Parameters
        ----------
        du : array_like, shape (nu,) or (N, nu)
            Steps from u0.

        Returns
        -------
        float or array, shape (N,)
            The error in the units of v.
        """
        values = np.atleast_2d(self(du))
        sizes = np.linalg.norm(newton_step(self.equations, self.u0 + np.atleast_2d(du), values), axis=1)
        return sizes if np.ndim(du) == 2 else float(sizes[0])

    def refined(self, du: ArrayLike) -> Array:
        """Return v with f(u, v) = 0 to rounding: Newton's method from the polynomial's value.

        Parameters
        ----------
        du : array_like, shape (nu,) or (N, nu)
            Steps from u0.

        Returns
        -------
        array, shape (nv,) or (N, nv)
            The dependent coordinates.

        Raises
        ------
        ToleranceNotReached
            When Newton's method does not end; the message names the first such point.
        """
        points = np.atleast_2d(np.asarray(du, dtype=float))
        v, last = newton(self.equations, self.u0 + points, np.atleast_2d(self(du)))
        bad = np.flatnonzero(~(last < 1e-9 * (1 + np.abs(v).max(axis=1))))
        if bad.size:
            raise ToleranceNotReached(
                "Newton's method from the Taylor value does not end",
                got=f"du = {points[bad[0]].tolist()}",
                todo="stay inside c.radius(direction), or expand about a nearer point",
            )
        return v if np.ndim(du) == 2 else v[0]

    def rates(self, u: ArrayLike, u1: ArrayLike, u2: ArrayLike) -> tuple[Array, Array, Array]:
        """Return v, v', v'' where u moves.

        The polynomial is refined by Newton's method, then a series of order 2 in time gives the rates.

        Parameters
        ----------
        u : array_like, shape (N, nu)
            The independent coordinates themselves, not du.
        u1 : array_like, shape (N, nu)
            Their rates, per s.
        u2 : array_like, shape (N, nu)
            Their accelerations, per s^2.

        Returns
        -------
        tuple of array, each of shape (N, nv)
            v, v', v''.

        Raises
        ------
        ToleranceNotReached
            When the loop does not close; the message names the first such point.
        """
        u, u1, u2 = (real_array(name, x, (None, len(self.u0))) for name, x in (("u", u), ("u1", u1), ("u2", u2)))
        v = self.refined(u - self.u0)
        parts = list(zip(u.T, u1.T, u2.T / 2, strict=True))
        moving = self.equations.expand(
            Space(1, 2, (len(u),)), lambda space: [space.polynomial((0,), one) for one in parts], v.T
        )
        value, first, second = np.moveaxis(moving, 0, 2)
        return value, first, 2 * second

    def radius(self, direction: ArrayLike) -> Radius:
        """Return how far |du| the series of v converges along a direction, with what limits it.

        The nearest point t in the complex plane where V(u0 + t d) is singular on this branch. A singularity behind counts as well:
        a power series converges in a disk.

        Parameters
        ----------
        direction : array_like, shape (nu,)
            The direction d, of any length but zero.

        Returns
        -------
        Radius
            A float that also bears kind, location, v, estimate and status.
        """
        return radius_along(self.equations, self.u0, self.v0, self.unit(direction))

    def linear_range(self, tol: float, direction: ArrayLike) -> float:
        """Return how far the linear map v0 + C_1 du stays within a tolerance along a direction.

            |du| = sqrt(2 tol / |C_2 d d|)

        Where C_2 d d = 0 the next term that is not zero takes its place.

        Parameters
        ----------
        tol : float
            Tolerance in the units of v.
        direction : array_like, shape (nu,)
            The direction d, of any length but zero.

        Returns
        -------
        float
            The range; infinite where no term bends.
        """
        tol = positive("tol", tol)
        series = line_series(self.equations, Space(1, max(4, self.order)), self.u0, self.v0, self.unit(direction))
        sizes = np.linalg.norm(series, axis=1)
        scale = max(sizes[1:].max(), np.finfo(float).tiny)
        bent = [k for k in range(2, len(sizes)) if sizes[k] > 1e-13 * scale]
        return float((tol / sizes[bent[0]]) ** (1 / bent[0])) if bent else float("inf")

    def function(self) -> ca.Function:
        """Return the polynomial as a CasADi function.

        Returns
        -------
        casadi.Function
            du (nu,) -> v (nv,).
        """
        du = ca.SX.sym("du", len(self.u0))
        return ca.Function("taylor", [du], [self.polynomial.expression(du)], ["du"], ["v"])

    @lazy
    def moving(self) -> ca.Function:
        """The whole computation unrolled: a casadi.Function (u0, v0, du) -> v for any point of evaluation."""
        return unrolled(self.equations, self.order, len(self.u0), len(self.v0))

    def unit(self, direction: ArrayLike) -> Array:
        """Return a checked direction of length 1.

        Parameters
        ----------
        direction : array_like, shape (nu,)
            A vector other than zero.

        Returns
        -------
        array, shape (nu,)
            The direction.

        Raises
        ------
        ArgumentError
            When the vector is zero or does not fit.
        """
        d = real_array("direction", direction, (len(self.u0),))
        length = np.linalg.norm(d)
        if length == 0:
            raise ArgumentError("the direction is zero", got=d.tolist(), expected="a vector other than zero")
        return d / length


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
    solution, last = newton(Equations.read(f, u, v), point[None, :], start[None, :], 50)
    if not last[0] < 1e-9 * (1 + np.abs(solution[0]).max()):
        raise ToleranceNotReached(
            "f(u0, v) = 0 has no solution that Newton's method reaches",
            got=f"guess {start.tolist()} at u0 = {point.tolist()}",
            todo="start nearer to a solution, or move u0 inside the workspace",
        )
    return solution[0]


def closed(equations: Equations, u0: Array, v0: Array) -> Array:
    """Return v0 refined to rounding, as it may be given with few digits; refuse a point that is no solution or singular."""
    f, V = equations.at(u0[None, :], v0[None, :])
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(V))):
        check_analytic(np.array(np.nan), "(u0, v0)", np.concatenate([u0, v0]))
    if np.linalg.cond(V[0]) > 1 / FAINT:
        raise singular_closure(equations, u0, v0)
    v, last = newton(equations, u0[None, :], v0[None, :])
    moved = np.abs(v[0] - v0).max()
    if not (last[0] < 1e-9 and moved < SLIGHT * (1 + np.abs(v0).max())):
        raise ArgumentError(
            "the point does not solve f(u, v) = 0",
            got=f"|f| = {np.abs(f).max():.3g}, v0 {moved:.3g} away from a solution",
            todo="solve for v0 first",
        )
    return v[0]


def singular_closure(equations: Equations, u0: Array, v0: Array) -> SingularClosure:
    """Return the error that names the singular configuration nearest to a point."""
    fold = find_fold(equations, u0, np.eye(len(u0)), (np.zeros(len(u0)), v0))
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
    equations, n = Equations.read(f, u, v), len(point)
    table = indices(n, order, 8 * len(equations.gap.steps) * comb(n + max(order, 0), n))
    solution = closed(equations, point, guess)

    def independent(space: Space) -> list[Jet]:
        return [space.variable(i, value) for i, value in enumerate(point)]

    coefficients = equations.expand(Space(n, order), independent, solution).T
    check_analytic(coefficients, "(u0, v0)", np.concatenate([point, solution]))
    return ImplicitMap(equations, Polynomial(table, coefficients), point, solution)
