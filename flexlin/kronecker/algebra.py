"""Kronecker products and powers, and the permutation that swaps their factors, for NumPy and CasADi matrices alike.

CasADi is loaded only when one of its matrices comes in.
"""

from importlib import import_module
from typing import Annotated, Any

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
