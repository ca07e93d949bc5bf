"""The rules of differentiation, for NumPy and CasADi matrices alike.

A derivative by x in R^n of a matrix (m, p) is a matrix (m, p n) with columns (j, i), i fastest: Khang, Dat, Tuan (2019), Eq (15).
"""

import numpy as np

from flexlin.arguments import checked
from flexlin.errors import ArgumentError
from flexlin.kronecker.algebra import Matrix, count_variables, expect_columns, kron, swap


@checked
def product_rule(A: Matrix, DA: Matrix, B: Matrix, DB: Matrix) -> Matrix:
    """Differentiate a product of matrices.

        D(A B) = DA (B (x) E_n) + A DB

    D is the derivative by a vector of R^n, with columns (j, i), i fastest.

    Parameters
    ----------
    A : array or CasADi matrix, shape (m, p)
        First factor.
    DA : array or CasADi matrix, shape (m, p n)
        Its derivative.
    B : array or CasADi matrix, shape (p, s)
        Second factor.
    DB : array or CasADi matrix, shape (p, s n)
        Its derivative.

    Returns
    -------
    array or CasADi matrix, shape (m, s n)
        The derivative of A B.

    Raises
    ------
    ArgumentError
        When the shapes do not fit.

    References
    ----------
    Khang, Dat, Tuan (2019), Eq (19); de Jong et al. (2018), Eq (18).

    Examples
    --------
    The derivative of x^2 = x x at x = 3:

    >>> import numpy as np
    >>> from flexlin.kronecker import product_rule
    >>> x, one = np.array([[3.0]]), np.array([[1.0]])
    >>> product_rule(x, one, x, one)
    array([[6.]])
    """
    n = count_variables("A", A, DA)
    expect_columns("DB", DB, B.shape[1] * n)
    return DA @ kron(B, np.eye(n)) + A @ DB


@checked
def chain_rule(DA: Matrix, Db: Matrix) -> Matrix:
    """Differentiate a matrix function of a vector that depends on another vector.

        D_c A = D_b A (E_p (x) D_c b),   A(b(c)),  b in R^r,  c in R^n

    Parameters
    ----------
    DA : array or CasADi matrix, shape (m, p r)
        Derivative of A by b.
    Db : array or CasADi matrix, shape (r, n)
        Derivative of b by c.

    Returns
    -------
    array or CasADi matrix, shape (m, p n)
        Derivative of A by c.

    Raises
    ------
    ArgumentError
        When the columns of DA are no multiple of the rows of Db.

    References
    ----------
    de Jong et al. (2018), Eq (19).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.kronecker import chain_rule
    >>> chain_rule(np.array([[1.0, 2.0]]), np.array([[10.0], [1.0]]))
    array([[12.]])
    """
    columns, rest = divmod(DA.shape[1], Db.shape[0])
    if rest:
        raise ArgumentError(
            "the inner derivative does not fit the outer one",
            got=Db.shape,
            expected="a divisor of DA's columns as rows",
        )
    return DA @ kron(np.eye(columns), Db)


@checked
def inverse_rule(A_inverse: Matrix, DA: Matrix) -> Matrix:
    """Differentiate an inverse matrix.

        D(A^-1) = -A^-1 DA (A^-1 (x) E_n)

    Parameters
    ----------
    A_inverse : array or CasADi matrix, shape (m, m)
        The inverse of A.
    DA : array or CasADi matrix, shape (m, m n)
        Derivative of A by a vector of R^n.

    Returns
    -------
    array or CasADi matrix, shape (m, m n)
        Derivative of the inverse.

    Raises
    ------
    ArgumentError
        When the shapes do not fit.

    References
    ----------
    de Jong et al. (2018), Eq (20).

    Examples
    --------
    The derivative of 1/x at x = 2:

    >>> import numpy as np
    >>> from flexlin.kronecker import inverse_rule
    >>> inverse_rule(np.array([[0.5]]), np.array([[1.0]]))
    array([[-0.25]])
    """
    n = count_variables("A_inverse", A_inverse, DA)
    return -A_inverse @ DA @ kron(A_inverse, np.eye(n))


@checked
def kronecker_rule(A: Matrix, DA: Matrix, B: Matrix, DB: Matrix) -> Matrix:
    """Differentiate a Kronecker product.

        D(A (x) B) = (DA (x) B)(E_p (x) P) + A (x) DB,   P (b (x) a) = a (x) b,  a in R^n,  b in R^q

    Parameters
    ----------
    A : array or CasADi matrix, shape (m, p)
        First factor.
    DA : array or CasADi matrix, shape (m, p n)
        Its derivative by a vector of R^n.
    B : array or CasADi matrix, shape (r, q)
        Second factor.
    DB : array or CasADi matrix, shape (r, q n)
        Its derivative.

    Returns
    -------
    array or CasADi matrix, shape (m r, p q n)
        The derivative of A (x) B.

    Raises
    ------
    ArgumentError
        When the shapes do not fit.

    References
    ----------
    Vetter (1973). Left open by de Jong et al. (2018) after Eq (24).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.kronecker import kronecker_rule
    >>> x, one = np.array([[3.0]]), np.array([[1.0]])
    >>> kronecker_rule(x, one, x, one)
    array([[6.]])
    """
    n, q = count_variables("A", A, DA), B.shape[1]
    expect_columns("DB", DB, q * n)
    return kron(DA, B) @ kron(np.eye(A.shape[1]), swap(n, q)) + kron(A, DB)
