"""Exact derivatives of Floquet exponents by the left and right modes."""

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.floquet.modes import FloquetModes


def differentiate_exponents(
    modes: FloquetModes, slope: ArrayLike, A: ArrayLike | None = None, period_slope: ArrayLike = 0.0
) -> Array:
    """Derivative of every exponent by every parameter.

        d lambda / d theta = (1/T) int_0^T q^H (dA/dtheta + (T'/T) A) p dt - lambda T'/T

    with dA/dtheta at fixed phase t/T and T' = dT/dtheta. Assumes a simple exponent: where two coincide only their mean has a
    derivative, and `modes.condition` is large.

    Parameters: slope: dA/dtheta (N, n, n) or (P, N, n, n) for P parameters, sampled at `modes.times`; A (N, n, n) there, and
    period_slope, one or (P,), where the period depends on the parameters.
    Returns: (n,) or (P, n) complex, in 1/s per unit of the parameter.
    Raises: ArgumentError on shapes, or when period_slope is given without A.
    Source: Seyranian, Mailybaev, Multiparameter Stability Theory (2003), section 9.3.
    """
    change = real_array("slope", slope)
    if change.shape[-3:] != (len(modes.times), *modes.right.shape[1:]):
        raise ArgumentError(
            "slope has the wrong shape", got=change.shape, expected=f"{(len(modes.times), *modes.right.shape[1:])}"
        )
    stretch = real_array("period_slope", period_slope)[..., None] / modes.period
    if np.any(stretch):
        if A is None:
            raise ArgumentError("the period varies but A is missing", expected="A sampled at modes.times")
        change = change + stretch[..., None, None] * real_array("A", A, modes.right.shape)
    moved = np.einsum("t,tki,...tkl,tli->...i", modes.weights, modes.left.conj(), change, modes.right, optimize=True)
    return moved - modes.exponents * stretch
