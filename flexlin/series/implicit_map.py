"""The Taylor map of an implicit function, which knows how far it may be trusted."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, check_size, positive, real_array
from flexlin.errors import ArgumentError, ToleranceNotReached
from flexlin.lazy import lazy
from flexlin.series.engine import Tape, expand_implicit, seeded
from flexlin.series.folds import Radius, closure_and_jacobian, line_series, newton, newton_step, radius_along
from flexlin.series.indices import Indices, Polynomial, shared_indices, symbolic_monomials, weighted_sums
from flexlin.series.space import Numeric, Symbolic
from flexlin.summary import represent

BYTES_PER_INSTRUCTION = 300
"""Memory that one scalar operation of an expression takes while it is built."""


def unrolled(tape: Tape, indices: Indices, V: Array) -> ca.Function:
    """Return (u0, v0, du) -> v, the Taylor polynomial about any solution (u0, v0), without loops, branches or linear solvers.

    Assumes that the pivots chosen for this V serve near by: elimination is not pivoted again.
    Raises: TooLarge when the expression would take an unreasonable number of bytes.
    """
    from scipy.linalg import lu  # takes longer to load than most maps to compute

    products = sum(len(indices.pairs(k).left) for k in range(indices.order + 1))
    size = 2 * BYTES_PER_INSTRUCTION * products * len(tape.operations)
    check_size("the unrolled function", size, "lower the order, or use the map in numbers")
    sizes = [len(tape.inputs[0]), len(tape.inputs[1]), len(tape.inputs[0])]
    u0, v0, du = (ca.SX.sym(name, size) for name, size in zip(("u0", "v0", "du"), sizes, strict=True))
    space = Symbolic(indices, lu(V)[0].argmax(axis=0))
    seeds = np.eye(len(tape.inputs[0]), dtype=int).astype(object)
    series = expand_implicit(tape, space, seeded(space, scalars(u0), seeds), scalars(v0))
    v = weighted_sums(np.array(series), symbolic_monomials(indices, du))
    return ca.Function("taylor", [u0, v0, du], [v], ["u0", "v0", "du"], ["v"])


def scalars(column: ca.SX) -> Array:
    """Return a CasADi column as an array of scalars."""
    array = np.empty(column.numel(), dtype=object)
    for i in range(column.numel()):
        array[i] = column[i]
    return array


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


@dataclass(frozen=True)
class ImplicitMap:
    """The Taylor polynomial of an implicit function v(u), f(u, v) = 0, about a point.

    Call it with du (nu,) to get v (nv,) at u0 + du, or with du (N, nu) to get (N, nv).

    Attributes
    ----------
    tape : Tape
        The operations of f.
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

    tape: Tape
    polynomial: Polynomial
    u0: Array
    v0: Array

    __repr__ = represent

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
        sizes = np.linalg.norm(newton_step(self.tape, self.u0 + np.atleast_2d(du), values), axis=1)
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
        v, last = newton(self.tape, self.u0 + points, np.atleast_2d(self(du)))
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
        space = Numeric(shared_indices(1, 2), (len(u),))
        series = expand_implicit(
            self.tape, space, [np.stack(parts) for parts in zip(u.T, u1.T, u2.T / 2, strict=True)], v.T
        )
        value, first, second = np.moveaxis(np.array(series), 0, 2)
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
        return radius_along(self.tape, self.u0, self.v0, self.unit(direction))

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
        series = line_series(self.tape, self.u0, self.v0, self.unit(direction), max(4, self.order))
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
        """The whole computation unrolled: a casadi.Function (u0, v0, du) -> v for any point of evaluation near this one."""
        _, V = closure_and_jacobian(self.tape, self.u0[None, :], self.v0[None, :])
        return unrolled(self.tape, self.polynomial.indices, V[0])

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
