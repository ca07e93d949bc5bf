"""The periodic Lyapunov equation at equally spaced times: its mean is inverted exactly, GMRES does the rest."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.quadratic.krylov import solve_by_gmres
from flexlin.periodic.quadratic.scattering import symmetrize, transpose

MOST = 80
"""Dimensions of the Krylov space: more are needed only where the mean says little of the loop."""


class CollocatedLyapunov:
    """D' + A' D + D A = right at N equally spaced times of a period, N odd, by trigonometric interpolation.

    The mean A0 = V diag(s) V^-1 has the exact inverse  (V' D V)_ij,k = (V' right V)_ij,k / (i k w + s_i + s_j)  of each harmonic
    k; it is the preconditioner. The rest, (A - A0)' D + D (A - A0), holds no derivative, so fast eigenvalues do no harm.

    Parameters: A (N, n, n), the samples of a loop; period in s; X (N, n, n): what D is compared with. GMRES measures D in units of
    the states in which X has about a diagonal of ones, so that what counts does not depend on units.
    """

    def __init__(self, A: Array, period: float, X: Array):
        units = measure_states(X)
        self.units = np.outer(units, units)
        A = A * (units[:, None] / units)
        mean = A.mean(axis=0)
        values, self.vectors = np.linalg.eig(mean)
        self.inverse = np.linalg.inv(self.vectors)
        waves = 2j * np.pi / period * np.arange(len(A) // 2 + 1)
        self.divisors = waves[:, None, None] + values[:, None] + values
        self.rest = A - mean

    def solve(self, right: Array, tol: float, enough: float) -> Array:
        """Return D (N, n, n), symmetric, of a symmetric right side, to about tol of its size; more than `enough` is no answer.

        Raises: ToleranceNotReached when the mean is no guide to the loop, or lies on the border of stability.
        """
        with np.errstate(all="ignore"):
            start = self.invert_mean(right / self.units)
            D, left = solve_by_gmres(self.apply, start, tol, MOST)
        if not left <= enough:
            raise ToleranceNotReached("the periodic Lyapunov equation was not solved", got=f"residual {left:.2g}")
        return symmetrize(D) * self.units

    def apply(self, D: Array) -> Array:
        """Return D + L0^-1 (the rest of D), L0 the mean operator."""
        product = D @ self.rest
        return D + self.invert_mean(product + transpose(product))

    def invert_mean(self, right: Array) -> Array:
        """Solve with the mean loop in place of the loop."""
        waves = self.change_basis(np.fft.rfft(right, axis=0), self.vectors) / self.divisors
        return np.asarray(np.fft.irfft(self.change_basis(waves, self.inverse), len(right), axis=0))

    @staticmethod
    def change_basis(D: Array, V: Array) -> Array:
        """Return V' D V for symmetric D (N, n, n), by two products of large matrices."""
        n = len(V)
        half = (D.reshape(-1, n) @ V).reshape(D.shape)
        return (np.swapaxes(half, 1, 2).reshape(-1, n) @ V).reshape(D.shape)


def measure_states(X: Array) -> Array:
    """Return the root of the largest diagonal entries of X (N, n, n), as powers of two: (n,)."""
    diagonal = np.sqrt(np.diagonal(X, axis1=1, axis2=2).clip(0.0).max(axis=0))
    least = 1e-8 * diagonal.max() + np.finfo(float).tiny
    return np.asarray(2.0 ** np.round(np.log2(np.maximum(diagonal, least))))
