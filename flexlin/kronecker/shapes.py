"""Shapes of matrices and of their derivatives in Kronecker layout."""

from typing import Any

from flexlin.errors import ArgumentError

Matrix = Any
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
