"""Kronecker products, powers and the rules of differentiation, for NumPy and CasADi matrices alike.

A derivative by x in R^n of a matrix (m, p) is a matrix (m, p n) with columns (j, i), i fastest: Khang, Dat, Tuan (2019), Eq (15).
CasADi is loaded only when one of its matrices comes in.
"""

from importlib import import_module
from typing import Any

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError

Matrix = Any
"""A two-dimensional numpy array or a CasADi matrix (SX, MX, DM)."""


def kron(A: Matrix, B: Matrix) -> Matrix:
    """Return A (x) B = [a_ij B]: Khang et al., Eq (2)."""
    if isinstance(A, np.ndarray) and isinstance(B, np.ndarray):
        return np.kron(A, B)
    return import_module("casadi").kron(A, B)


def kronecker_power(A: Matrix, k: int) -> Matrix:
    """Return A^(x)k = A (x) A (x) ... (x) A, k >= 1 factors: Khang et al., Eqs (11), (12)."""
    if k < 1:
        raise ArgumentError("a Kronecker power needs at least one factor", got=k, expected="1, 2, 3 ...")
    return A if k == 1 else kron(A, kronecker_power(A, k - 1))


def swap(n: int, q: int) -> Array:
    """Return the permutation that exchanges two Kronecker factors.

        P (b (x) a) = a (x) b   for all a in R^n, b in R^q

    Returns: P of shape (n q, n q).
    Source: Vetter (1973); the permutation that de Jong et al. (2018) leave out of Eq (24).
    """
    return np.eye(n * q)[np.arange(n * q).reshape(q, n).T.ravel()]


def product_rule(A: Matrix, DA: Matrix, B: Matrix, DB: Matrix) -> Matrix:
    """Differentiate a product of matrices.

        D(A B) = DA (B (x) E_n) + A DB

    Parameters: A (m, p), DA (m, p n), B (p, s), DB (p, s n).
    Returns: (m, s n).
    Raises: ArgumentError when the shapes do not fit.
    Source: Khang et al., Eq (19); de Jong et al., Eq (18).
    """
    n = count_variables("A", A, DA)
    expect_columns("DB", DB, B.shape[1] * n)
    return DA @ kron(B, np.eye(n)) + A @ DB


def chain_rule(DA: Matrix, Db: Matrix) -> Matrix:
    """Differentiate A(b(c)), a matrix function of a vector b in R^r, by c in R^n.

        D_c A = D_b A (E_p (x) D_c b)

    Parameters: DA = D_b A (m, p r), Db = D_c b (r, n).
    Returns: (m, p n).
    Source: de Jong et al., Eq (19).
    """
    columns, rest = divmod(DA.shape[1], Db.shape[0])
    if rest:
        raise ArgumentError(
            "the inner derivative does not fit the outer one",
            got=Db.shape,
            expected="a divisor of DA's columns as rows",
        )
    return DA @ kron(np.eye(columns), Db)


def inverse_rule(A_inverse: Matrix, DA: Matrix) -> Matrix:
    """Differentiate an inverse.

        D(A^-1) = -A^-1 DA (A^-1 (x) E_n)

    Parameters: A_inverse = A^-1 (m, m), DA (m, m n).
    Returns: (m, m n).
    Source: de Jong et al., Eq (20).
    """
    n = count_variables("A_inverse", A_inverse, DA)
    return -A_inverse @ DA @ kron(A_inverse, np.eye(n))


def kronecker_rule(A: Matrix, DA: Matrix, B: Matrix, DB: Matrix) -> Matrix:
    """Differentiate a Kronecker product.

        D(A (x) B) = (DA (x) B)(E_p (x) P) + A (x) DB,   P (b (x) a) = a (x) b,  a in R^n,  b in R^q

    Parameters: A (m, p), DA (m, p n), B (r, q), DB (r, q n).
    Returns: (m r, p q n).
    Raises: ArgumentError when the shapes do not fit.
    Source: Vetter (1973); left open by de Jong et al. (2018) after Eq (24).
    """
    n, q = count_variables("A", A, DA), B.shape[1]
    expect_columns("DB", DB, q * n)
    return kron(DA, B) @ kron(np.eye(A.shape[1]), swap(n, q)) + kron(A, DB)


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
