"""Shapes of matrices and of their derivatives in Kronecker layout."""

from typing import Annotated, Any

from flexlin.arguments import Kind
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
