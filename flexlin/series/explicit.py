"""Taylor maps of explicit functions, each series held in the variables that it depends on."""

from typing import Annotated, Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import Kind, checked, instance
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.program import Program
from flexlin.series.indices import Polynomial, indices
from flexlin.series.jets import Space, bytes_of, carry_out, scalar_function
from flexlin.summary import immutable
from flexlin.symbolic import as_expression

Expression = Annotated[Any, Kind("a CasADi expression", lambda value: isinstance(value, (ca.SX, ca.MX, ca.DM)))]


@immutable
class TaylorMap:
    """The Taylor polynomial of a matrix function.

        A(x0 + dx) ~ sum_k 1/k! D^k A(x0) (E_p (x) dx^(x)k)

    Call it with dx (n,) to get the value (m, p), or with dx (N, n) to get (N, m, p).

    Attributes
    ----------
    polynomial : Polynomial
        The coefficients, each monomial stored once.
    x0 : array, shape (n,)
        Where it is expanded.
    shape : tuple of int
        (m, p).

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> x = ca.SX.sym("x", 2)
    >>> P = fl.taylor(x[0] * x[1] ** 2, x, [1.0, 2.0], 3)
    >>> P([0.5, 0.0]).item(), P.derivative(1).tolist()
    (6.0, [[4.0, 4.0]])
    """

    polynomial: Polynomial
    x0: Array
    shape: tuple[int, int]

    @property
    def order(self) -> int:
        """The highest degree."""
        return self.polynomial.indices.order

    @checked
    def __call__(self, dx: ArrayLike) -> Array:
        """Return the values (m, p) at dx (n,), or (N, m, p) at dx (N, n)."""
        values = self.polynomial(dx)
        rows, columns = self.shape
        return values.reshape(*values.shape[:-1], columns, rows).swapaxes(-1, -2)

    def derivative(self, k: int) -> Array:
        """Return a derivative at x0 in Kronecker layout.

        Parameters
        ----------
        k : int
            Its order, at most that of the map.

        Returns
        -------
        array, shape (m, p n^k)
            D^k A(x0).

        Raises
        ------
        ArgumentError
            For an order that is not known.
        TooLarge
            When the layout would not fit into memory.

        References
        ----------
        Khang, Dat, Tuan (2019), Eqs (15), (18).
        """
        rows, columns = self.shape
        return self.polynomial.kronecker(k).reshape(columns, rows, -1).swapaxes(0, 1).reshape(rows, -1)

    def function(self) -> ca.Function:
        """Return the polynomial as a CasADi function.

        Returns
        -------
        casadi.Function
            dx (n,) -> A (m, p).
        """
        dx = ca.SX.sym("dx", len(self.x0))
        return ca.Function("taylor", [dx], [ca.reshape(self.polynomial.expression(dx), *self.shape)], ["dx"], ["A"])


@checked
def taylor(A: Expression, x: Expression, x0: ArrayLike, order: int) -> TaylorMap:
    """Expand a scalar, vector or matrix function of a vector.

        A(x0 + dx) ~ A(x0) + sum_(k=1..order) 1/k! D^k A(x0) (E_p (x) dx^(x)k)

    by truncated power series on the expression's own operations; each mixed derivative is computed and stored once.
    Assumes that A is analytic at x0.

    Parameters
    ----------
    A : casadi.SX or casadi.MX, shape (m, p)
        An expression of x only.
    x : casadi.SX or casadi.MX, shape (n, 1)
        A column of symbols.
    x0 : array_like, shape (n,)
        Where to expand.
    order : int
        The highest degree, from 0 on.

    Returns
    -------
    TaylorMap
        P: P(dx) (m, p), P.derivative(k) (m, p n^k), P.function().

    Raises
    ------
    ArgumentError
        On shapes, free symbols, and operations or points without a power series.
    TooLarge
        When the coefficients would not fit into memory; the message gives the bytes.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (36), (41), (47).

    Examples
    --------
    >>> import casadi as ca
    >>> import numpy as np
    >>> import flexlin as fl
    >>> x = ca.SX.sym("x")
    >>> P = fl.taylor(ca.sin(x), x, [0.0], 7)
    >>> print(f"{P([0.5]).item():.8f} {np.sin(0.5):.8f}")
    0.47942553 0.47942554
    """
    check_symbols("x", x)
    A = A if isinstance(A, ca.MX) else as_expression("A", A)
    point = real_array("x0", x0, (x.numel(),))
    program, n = Program.read(scalar_function("A", [ca.vec(A)], [x])), len(point)
    table = indices(n, order, bytes_of(program, n, [[(i,) for i in range(n)]], max(order, 0)))
    space = Space(n, order)
    (jets,) = carry_out(program, [space.variable(i, value) for i, value in enumerate(point)])
    coefficients = np.array([jet.whole for jet in jets]).T.reshape(table.size, -1)
    check_analytic(coefficients, "x0", point)
    return TaylorMap(Polynomial(table, coefficients), point, A.shape)


def check_symbols(name: str, x: Any) -> None:
    """Check that x is a column of symbols."""
    instance(name, x, (ca.SX, ca.MX), "give a vector of CasADi symbols")
    if not (x.is_column() and x.is_valid_input() and x.numel()):
        raise ArgumentError(f"{name} is not a column of symbols", got=x, expected="SX.sym or MX.sym of shape (n, 1)")


def check_analytic(coefficients: Array, name: str, point: Array) -> None:
    """Refuse a point where the series does not exist."""
    if not np.all(np.isfinite(coefficients)):
        raise ArgumentError(
            "the expression has no power series here", got=f"{name} = {point.tolist()}", todo="move the point"
        )
