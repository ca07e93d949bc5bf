"""Taylor expansion and linearization of matrix functions from their Kronecker derivatives, NumPy and CasADi alike."""

from collections.abc import Sequence
from math import factorial
from typing import NamedTuple

import numpy as np

from flexlin.arguments import checked
from flexlin.errors import ArgumentError
from flexlin.kronecker.algebra import Matrix, chain_rule, expect_columns, kron, kronecker_power


class LinearizedProduct(NamedTuple):
    """A(x, y) y ~ value + by_y (y - y0) + by_x (x - x0)."""

    value: Matrix
    by_y: Matrix
    by_x: Matrix


@checked
def taylor_sum(derivatives: Sequence[Matrix], delta: Matrix) -> Matrix:
    """Sum a Taylor expansion of a scalar, vector or matrix function.

        A(x0 + delta) ~ A(x0) + sum_j  1/j! D^j A(x0) (E_p (x) delta^(x)j)

    Parameters
    ----------
    derivatives : sequence of array or CasADi matrix
        A(x0) (m, p), D A (m, p n), D^2 A (m, p n^2) and so on.
    delta : array or CasADi matrix, shape (n, 1)
        Step from x0.

    Returns
    -------
    array or CasADi matrix, shape (m, p)
        The value of the polynomial.

    Raises
    ------
    ArgumentError
        When the width of a derivative does not fit.

    References
    ----------
    Khang, Dat, Tuan (2019), Eq (47), with its cases (36) for scalars and (41) for vectors.

    Examples
    --------
    exp(0.1) from the first three derivatives at 0:

    >>> import numpy as np
    >>> from flexlin.kronecker import taylor_sum
    >>> one = np.array([[1.0]])
    >>> print(f"{taylor_sum([one, one, one, one], np.array([[0.1]])).item():.6f}")
    1.105167
    """
    if not derivatives:
        raise ArgumentError("a Taylor sum needs the value at least", got="no derivatives", expected="[A, DA, D2A ...]")
    total = derivatives[0]
    for j, DjA in enumerate(derivatives[1:], start=1):
        expect_columns(f"derivative {j}", DjA, total.shape[1] * delta.shape[0] ** j)
        total = total + chain_rule(DjA, kronecker_power(delta, j)) / factorial(j)
    return total


@checked
def linearization(A0: Matrix, *terms: tuple[Matrix, Matrix]) -> Matrix:
    """Linearize a matrix function of one, two or more vectors.

        A(x, y) ~ A(x0, y0) + dA/dx (E_p (x) dx) + dA/dy (E_p (x) dy)

    Parameters
    ----------
    A0 : array or CasADi matrix, shape (m, p)
        The value at the point.
    *terms : tuple of two arrays or CasADi matrices
        A pair (dA/dx (m, p n), dx (n, 1)) for each vector.

    Returns
    -------
    array or CasADi matrix, shape (m, p)
        The linear approximation.

    Raises
    ------
    ArgumentError
        When a derivative does not fit its vector.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (48), (50).

    Examples
    --------
    x y near x = 2, y = 3:

    >>> import numpy as np
    >>> from flexlin.kronecker import linearization
    >>> step = np.array([[0.1]])
    >>> linearization(np.array([[6.0]]), (np.array([[3.0]]), step), (np.array([[2.0]]), step))
    array([[6.5]])
    """
    total = A0
    for DA, delta in terms:
        expect_columns("a derivative", DA, A0.shape[1] * delta.shape[0])
        total = total + chain_rule(DA, delta)
    return total


@checked
def bilinear_term(DxDyA: Matrix, dx: Matrix, dy: Matrix) -> Matrix:
    """Return the mixed second-order term of a matrix function of two vectors.

        d/dx (dA/dy) (E_(p ny) (x) dx)(E_p (x) dy)

    Parameters
    ----------
    DxDyA : array or CasADi matrix, shape (m, p ny nx)
        Derivative first by y, then by x.
    dx : array or CasADi matrix, shape (nx, 1)
        Step of x.
    dy : array or CasADi matrix, shape (ny, 1)
        Step of y.

    Returns
    -------
    array or CasADi matrix, shape (m, p)
        The term.

    Raises
    ------
    ArgumentError
        When the derivative does not fit its vectors.

    References
    ----------
    Khang, Dat, Tuan (2019), last term of Eq (49), with E_(p ny) where E_p is printed.

    Examples
    --------
    The mixed term of A = x y is dx dy:

    >>> import numpy as np
    >>> from flexlin.kronecker import bilinear_term
    >>> bilinear_term(np.array([[1.0]]), np.array([[0.5]]), np.array([[0.25]]))
    array([[0.125]])
    """
    return chain_rule(chain_rule(DxDyA, dx), dy)


@checked
def linearized_product(A0: Matrix, y0: Matrix, DyA: Matrix, DxA: Matrix) -> LinearizedProduct:
    """Linearize a matrix function times one of its own vectors.

        A(x, y) y ~ A0 y0 + (A0 + dA/dy (y0 (x) E_ny)) dy + dA/dx (y0 (x) E_nx) dx

    With dA/dy = 0 this is Eq (53) of the paper.

    Parameters
    ----------
    A0 : array or CasADi matrix, shape (m, p)
        A at (x0, y0).
    y0 : array or CasADi matrix, shape (p, 1)
        The vector that A multiplies.
    DyA : array or CasADi matrix, shape (m, p p)
        Derivative of A by y.
    DxA : array or CasADi matrix, shape (m, p nx)
        Derivative of A by x.

    Returns
    -------
    LinearizedProduct
        value (m, 1), by_y (m, p), by_x (m, nx).

    References
    ----------
    Khang, Dat, Tuan (2019), Eq (52), with the identities E_ny and E_nx where E_n is printed.

    Examples
    --------
    y^2 x, read as (x y) y, near x = 2, y = 3:

    >>> import numpy as np
    >>> from flexlin.kronecker import linearized_product
    >>> product = linearized_product(*[np.array([[value]]) for value in (6.0, 3.0, 2.0, 3.0)])
    >>> [part.item() for part in product]
    [18.0, 12.0, 9.0]
    """
    by_y = A0 + DyA @ kron(y0, np.eye(y0.shape[0]))
    nx = DxA.shape[1] // A0.shape[1]
    return LinearizedProduct(A0 @ y0, by_y, DxA @ kron(y0, np.eye(nx)))
