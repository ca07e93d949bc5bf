"""Derivatives of CasADi matrices with respect to a vector, in the Kronecker layout of Khang, Dat and Tuan (2019)."""

import casadi as ca

from flexlin.arguments import checked
from flexlin.errors import ArgumentError


@checked
def derivative(A: ca.SX, x: ca.SX, order: int = 1) -> ca.SX:
    """Differentiate a CasADi matrix with respect to a vector, once or several times.

        dA/dx = [da_1/dx ... da_p/dx],   d^k A/dx^k = d/dx (d^(k-1) A/dx^(k-1))

    so the column index of the result is (j, i_1, ..., i_k) with i_k fastest.

    Parameters
    ----------
    A : casadi.SX, shape (m, p)
        The expression.
    x : casadi.SX, shape (n, 1)
        A column of symbols.
    order : int
        Number of differentiations k, from 0 on.

    Returns
    -------
    casadi.SX, shape (m, p n^k)
        The derivative.

    Raises
    ------
    ArgumentError
        When x is not a column of symbols or the order is negative.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (15) and (18).

    Examples
    --------
    >>> import casadi as ca
    >>> from flexlin.kronecker import derivative
    >>> x = ca.SX.sym("x", 2)
    >>> derivative(x[0] * x[1], x, 2)
    SX(@1=1, [[00, @1, @1, 00]])
    """
    if not (x.is_column() and x.is_valid_input()):
        raise ArgumentError("x is not a column of symbols", got=x, expected="SX.sym or MX.sym of shape (n, 1)")
    if order < 0:
        raise ArgumentError("the order of a derivative is negative", got=order, expected="0, 1, 2 ...")
    if order == 0:
        return A
    rows, columns = A.shape
    jacobian = ca.jacobian(ca.vec(A), x)
    first = ca.horzcat(*ca.vertsplit(jacobian, rows)) if columns else ca.SX(rows, 0)
    return derivative(first, x, order - 1)
