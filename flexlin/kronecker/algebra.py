"""Kronecker products and powers, the rules of differentiation, and Taylor expansion by Kronecker derivatives, NumPy and CasADi alike.

A derivative by x in R^n of a matrix (m, p) is a matrix (m, p n) with columns (j, i), i fastest: Khang, Dat, Tuan (2019), Eq (15).

CasADi is loaded only when one of its matrices comes in.
"""

from collections.abc import Sequence
from importlib import import_module
from math import factorial
from typing import Annotated, Any, NamedTuple

import numpy as np

from flexlin.arguments import Kind, checked
from flexlin.checks import Array, check_size, whole
from flexlin.errors import ArgumentError


def is_matrix(value: Any) -> bool:
    """Whether it has two dimensions of numbers or expressions."""
    kind = getattr(getattr(value, "dtype", None), "kind", "O" if hasattr(value, "nnz") else "")
    return kind in ("b", "i", "u", "f", "c", "O") and len(getattr(value, "shape", ())) == 2


Matrix = Annotated[Any, Kind("a matrix: a two-dimensional array or a CasADi expression", is_matrix)]
"""A two-dimensional numpy array or a CasADi matrix (SX, MX, DM)."""


def count_variables(name: str, A: Matrix, DA: Matrix) -> int:
    """Return n, the number of variables by which DA (m, p n) differentiates A (m, p)."""
    n, rest = divmod(DA.shape[1], A.shape[1])
    if rest or DA.shape[0] != A.shape[0]:
        raise ArgumentError(
            f"the derivative does not fit {name}", got=DA.shape, expected=f"({A.shape[0]}, {A.shape[1]} n)"
        )
    return n


def expect_columns(name: str, matrix: Matrix, columns: int) -> None:
    """Check the width of a matrix."""
    if matrix.shape[1] != columns:
        raise ArgumentError(f"{name} has the wrong number of columns", got=matrix.shape[1], expected=str(columns))


@checked
def kron(A: Matrix, B: Matrix) -> Matrix:
    """Return the Kronecker product of two matrices.

        A (x) B = [a_ij B]

    Parameters
    ----------
    A : array or CasADi matrix, shape (m, p)
        First factor.
    B : array or CasADi matrix, shape (r, q)
        Second factor.

    Returns
    -------
    array or CasADi matrix, shape (m r, p q)
        The product; CasADi when one of the factors is.

    References
    ----------
    Khang, Dat, Tuan (2019), Eq (2).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.kronecker import kron
    >>> kron(np.array([[1.0, 2.0]]), np.eye(2))
    array([[1., 0., 2., 0.],
           [0., 1., 0., 2.]])
    """
    if isinstance(A, np.ndarray) and isinstance(B, np.ndarray):
        return np.kron(A, B)
    return import_module("casadi").kron(A, B)


@checked
def kronecker_power(A: Matrix, k: int) -> Matrix:
    """Return a Kronecker power.

        A^(x)k = A (x) A (x) ... (x) A,   k factors

    Parameters
    ----------
    A : array or CasADi matrix, shape (m, p)
        The factor.
    k : int
        Number of factors, at least 1.

    Returns
    -------
    array or CasADi matrix, shape (m^k, p^k)
        The power.

    Raises
    ------
    ArgumentError
        When k is smaller than 1.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (11), (12).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.kronecker import kronecker_power
    >>> kronecker_power(np.array([[1.0], [3.0]]), 2).ravel()
    array([1., 3., 3., 9.])
    """
    if k < 1:
        raise ArgumentError("a Kronecker power needs at least one factor", got=k, expected="1, 2, 3 ...")
    entries = (A.shape[0] * A.shape[1]) ** min(k, 2000)
    check_size(f"a Kronecker power of {k} factors", 8 * max(entries, k), "take fewer factors")
    return A if k == 1 else kron(A, kronecker_power(A, k - 1))


@checked
def swap(n: int, q: int) -> Array:
    """Return the permutation that exchanges two Kronecker factors.

        P (b (x) a) = a (x) b   for all a in R^n, b in R^q

    Parameters
    ----------
    n : int
        Length of a.
    q : int
        Length of b.

    Returns
    -------
    array, shape (n q, n q)
        The permutation matrix P.

    References
    ----------
    Vetter (1973). It is the permutation that de Jong et al. (2018) leave out of Eq (24).

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.kronecker import swap
    >>> a, b = np.array([1.0, 2.0]), np.array([3.0, 4.0, 5.0])
    >>> bool(np.all(swap(2, 3) @ np.kron(b, a) == np.kron(a, b)))
    True
    """
    n, q = whole("n", n), whole("q", q)
    check_size(f"the permutation of {n * q} entries", 8 * (n * q) ** 2, "swap smaller factors")
    return np.eye(n * q)[np.arange(n * q).reshape(q, n).T.ravel()]


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
