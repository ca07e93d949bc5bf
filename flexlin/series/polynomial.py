"""A truncated Taylor polynomial with each monomial stored once, and its ways out: values, Kronecker layout, CasADi."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, check_size, real_array
from flexlin.errors import ArgumentError
from flexlin.series.indices import Indices
from flexlin.summary import represent


@dataclass(frozen=True)
class Polynomial:
    """p(dx) = sum_alpha c_alpha dx^alpha, |alpha| <= order, for several outputs.

    Parameters: indices; coefficients (size, outputs).
    """

    indices: Indices
    coefficients: Array

    __repr__ = represent

    def __call__(self, dx: ArrayLike) -> Array:
        """Return the values (..., outputs) at dx (n,) or (N, n)."""
        n = self.indices.n
        points = real_array("dx", dx, (None, n) if np.ndim(dx) == 2 else (n,))
        return self.indices.monomials(points) @ self.coefficients

    def kronecker(self, k: int) -> Array:
        """Return the k-th derivative at the point of evaluation in Kronecker layout.

            D^k p, columns (i_1 ... i_k), i_k fastest:  alpha! c_alpha

        Returns: (outputs, n^k).
        Raises: ArgumentError when k is not in 0 ... order; TooLarge when it would take an unreasonable number of bytes.
        """
        if not 0 <= k <= self.indices.order:
            raise ArgumentError("no such derivative is known", got=k, expected=f"0 to {self.indices.order}")
        size = 8 * self.indices.n**k * (2 + self.coefficients.shape[1])
        check_size(
            f"derivative {k} in Kronecker layout", size, "use the polynomial itself, which holds each derivative once"
        )
        places = self.indices.dense(k)
        return self.coefficients.T[:, places] * self.indices.factorials[places]

    def expression(self, dx: Any) -> ca.SX:
        """Return the polynomial as a CasADi column (outputs, 1) of dx, shared monomials computed once."""
        monomials = symbolic_monomials(self.indices, dx)
        return weighted_sums(self.coefficients.T, monomials)


def symbolic_monomials(indices: Indices, dx: Any) -> list[Any]:
    """Return all monomials of a CasADi column."""
    monomials: list[Any] = [ca.SX(1)]
    for parent, last in zip(indices.parent[1:], indices.last[1:], strict=True):
        monomials.append(monomials[parent] * dx[int(last)])
    return monomials


def weighted_sums(weights: Array, monomials: list[Any]) -> ca.SX:
    """Return weights @ monomials as a CasADi column, leaving zero weights out; weights: numbers or CasADi scalars (rows, size)."""
    if weights.dtype != object:
        return ca.densify(ca.sparsify(ca.DM(weights)) @ ca.vertcat(*monomials))
    rows = []
    for row in weights:
        total = ca.SX(0)
        for weight, monomial in zip(row, monomials, strict=True):
            if not (isinstance(weight, int | float) and weight == 0):
                total = total + weight * monomial
        rows.append(total)
    return ca.densify(ca.vertcat(*rows))
