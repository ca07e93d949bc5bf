"""Taylor expansion and linearization of matrix functions from their Kronecker derivatives, NumPy and CasADi alike."""

from collections.abc import Sequence
from math import factorial
from typing import NamedTuple

import numpy as np

from flexlin.errors import ArgumentError
from flexlin.kronecker.algebra import Matrix, expect_columns, kron, kronecker_power


class LinearizedProduct(NamedTuple):
    """A(x, y) y ~ value + by_y (y - y0) + by_x (x - x0)."""

    value: Matrix
    by_y: Matrix
    by_x: Matrix


def taylor_sum(derivatives: Sequence[Matrix], delta: Matrix) -> Matrix:
    """Sum a Taylor expansion of a scalar, vector or matrix function.

        A(x0 + delta) ~ A(x0) + sum_j  1/j! D^j A(x0) (E_p (x) delta^(x)j)

    Parameters: derivatives: A(x0) (m, p), D A (m, p n), D^2 A (m, p n^2) ...; delta: (n, 1).
    Returns: (m, p).
    Raises: ArgumentError when a derivative's width does not fit.
    Source: Khang et al., Eq (47), and its cases (36) for scalars and (41) for vectors.
    """
    total = derivatives[0]
    for j, DjA in enumerate(derivatives[1:], start=1):
        expect_columns(f"derivative {j}", DjA, total.shape[1] * delta.shape[0] ** j)
        total = total + multiply_first_order(DjA, kronecker_power(delta, j)) / factorial(j)
    return total


def linearization(A0: Matrix, *terms: tuple[Matrix, Matrix]) -> Matrix:
    """Linearize a matrix function of one, two or more vectors.

        A(x, y) ~ A(x0, y0) + dA/dx (E_p (x) dx) + dA/dy (E_p (x) dy)

    Parameters: A0 (m, p); terms: pairs (dA/dx (m, p n), dx (n, 1)), one for each vector.
    Returns: (m, p).
    Source: Khang et al., Eqs (48), (50).
    """
    total = A0
    for DA, delta in terms:
        expect_columns("a derivative", DA, A0.shape[1] * delta.shape[0])
        total = total + multiply_first_order(DA, delta)
    return total


def bilinear_term(DxDyA: Matrix, dx: Matrix, dy: Matrix) -> Matrix:
    """Return the mixed second-order term of a matrix function of two vectors.

        d/dx (dA/dy) (E_(p ny) (x) dx)(E_p (x) dy)

    Parameters: DxDyA (m, p ny nx): first by y, then by x; dx (nx, 1), dy (ny, 1).
    Returns: (m, p).
    Source: Khang et al., Eq (49), last term, with E_(p ny) where E_p is printed.
    """
    return multiply_first_order(multiply_first_order(DxDyA, dx), dy)


def linearized_product(A0: Matrix, y0: Matrix, DyA: Matrix, DxA: Matrix) -> LinearizedProduct:
    """Linearize a matrix function times one of its own vectors.

        A(x, y) y ~ A0 y0 + (A0 + dA/dy (y0 (x) E_ny)) dy + dA/dx (y0 (x) E_nx) dx

    With dA/dy = 0 this is Eq (53).

    Parameters: A0 (m, p), y0 (p, 1), DyA (m, p p), DxA (m, p nx), all at (x0, y0).
    Returns: value (m, 1), by_y (m, p), by_x (m, nx).
    Source: Khang et al., Eq (52), with the identities E_ny and E_nx where E_n is printed.
    """
    by_y = A0 + DyA @ kron(y0, np.eye(y0.shape[0]))
    nx = DxA.shape[1] // A0.shape[1]
    return LinearizedProduct(A0 @ y0, by_y, DxA @ kron(y0, np.eye(nx)))


def multiply_first_order(DA: Matrix, delta: Matrix) -> Matrix:
    """Return DA (E_p (x) delta), with p read off the widths."""
    columns, rest = divmod(DA.shape[1], delta.shape[0])
    if rest:
        raise ArgumentError("a derivative does not fit its vector", got=(DA.shape, delta.shape))
    return DA @ kron(np.eye(columns), delta)
