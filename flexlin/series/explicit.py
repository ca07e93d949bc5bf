"""Taylor maps of scalar, vector and matrix expressions."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.series.engine import expand, seeded
from flexlin.series.indices import indices
from flexlin.series.polynomial import Polynomial
from flexlin.series.recording import record_expressions
from flexlin.series.space import Numeric
from flexlin.summary import represent


@dataclass(frozen=True)
class TaylorMap:
    """The Taylor polynomial of a matrix function, A(x0 + dx) ~ sum_k 1/k! D^k A(x0) (E_p (x) dx^(x)k)."""

    polynomial: Polynomial
    x0: Array
    shape: tuple[int, int]

    __repr__ = represent

    @property
    def order(self) -> int:
        """The highest degree."""
        return self.polynomial.indices.order

    def __call__(self, dx: ArrayLike) -> Array:
        """Return the values (m, p) at dx (n,), or (N, m, p) at dx (N, n)."""
        values = self.polynomial(dx)
        rows, columns = self.shape
        return values.reshape(*values.shape[:-1], columns, rows).swapaxes(-1, -2)

    def derivative(self, k: int) -> Array:
        """Return D^k A(x0) (m, p n^k) in the layout of Khang et al., Eqs (15), (18)."""
        rows, columns = self.shape
        return self.polynomial.kronecker(k).reshape(columns, rows, -1).swapaxes(0, 1).reshape(rows, -1)

    def function(self) -> ca.Function:
        """Return the polynomial as a casadi.Function dx -> A (m, p)."""
        dx = ca.SX.sym("dx", len(self.x0))
        return ca.Function("taylor", [dx], [ca.reshape(self.polynomial.expression(dx), *self.shape)], ["dx"], ["A"])


def taylor(A: Any, x: Any, x0: ArrayLike, order: int) -> TaylorMap:
    """Expand a scalar, vector or matrix function of a vector.

        A(x0 + dx) ~ A(x0) + sum_(k=1..order) 1/k! D^k A(x0) (E_p (x) dx^(x)k)

    by truncated power series on the expression's own operations; each mixed derivative is computed and stored once.

    Assumes that A is analytic at x0.
    Parameters: A: CasADi expression (m, p) of x only; x: column of symbols (n,); x0 (n,); order >= 0.
    Returns: a TaylorMap P: P(dx) (m, p), P.derivative(k) (m, p n^k), P.function().
    Raises: ArgumentError on shapes, free symbols, operations or points without a power series; TooLarge with the bytes wanted.
    Source: Khang, Dat, Tuan (2019), Eqs (36), (41), (47).
    """
    check_symbols("x", x)
    point = real_array("x0", x0, (x.numel(),))
    tape = record_expressions("A", [ca.vec(A)], [x])
    table = indices(x.numel(), order, tape.size)
    space = Numeric(table)
    (outputs,) = expand(tape, space, [seeded(space, point, np.eye(len(point)))])
    coefficients = np.array(outputs).T.reshape(table.size, -1)
    check_analytic(coefficients, "x0", point)
    return TaylorMap(Polynomial(table, coefficients), point, A.shape)


def check_symbols(name: str, x: Any) -> None:
    """Check that x is a column of symbols."""
    if not (isinstance(x, ca.SX | ca.MX) and x.is_column() and x.is_valid_input() and x.numel()):
        raise ArgumentError(f"{name} is not a column of symbols", got=x, expected="SX.sym or MX.sym of shape (n, 1)")


def check_analytic(coefficients: Array, name: str, point: Array) -> None:
    """Refuse a point where the series does not exist."""
    if not np.all(np.isfinite(coefficients)):
        raise ArgumentError(
            "the expression has no power series here", got=f"{name} = {point.tolist()}", todo="move the point"
        )
