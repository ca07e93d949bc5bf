"""A bound on the error of a Riccati solution from its residual alone: X is a Lyapunov function that decays by the running cost."""

import ctypes

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_basis, fourier_nodes
from flexlin.periodic.quadratic.backward import Samples, find_share
from flexlin.periodic.quadratic.evidence import ROUNDING
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, take_once
from flexlin.periodic.quadratic.scattering import transpose
from flexlin.periodic.quadratic.solution import RiccatiSolution

FINER = 3
"""Times at which the residual is looked at, for each harmonic of X and of the coefficients."""
MOST_SHARE = 0.5


def judge_by_cost(
    problem: LinearQuadratic, library: ctypes.CDLL, X: FourierSeries, waves: float, rate: float
) -> RiccatiSolution | None:
    """Put the solution together with a bound on its error; None where its residual is not small against the running cost.

        F = X' + A' X + X A - X S X + Q,   C = Q + X S X,   -r C <= F <= r C,   r < 1,   X > 0 at one time

    Then X' + Ac' X + X Ac = F - C <= -(1 - r) C, so the loop Ac = A - S X is stable where C > 0; the residual of X / (1 - r) is
    negative, that of (1 - r) X positive, and the stabilising solution lies between these two:

        |E_ij| <= k sqrt(X_ii X_jj),   k = r / (1 - r)

    Assumes that F is smooth between the times at which it is compared with C.
    Source: Bittanti, Colaneri, De Nicolao, The periodic Riccati equation, in The Riccati Equation (1991), ch. 6 (comparison).

    Parameters: X (n, w), rows filled up with zeros; waves: of the coefficients; rate: the Hamiltonian's spectral radius.
    """
    count, T = 1 + FINER * (X.harmonics + int(waves)), X.period
    n = X.coefficients.shape[1]
    t = fourier_nodes(count, T) + T / (2 * count)
    values, slopes = evaluate_with_slopes(X, t)
    samples = Samples.of(problem.reduced(t))
    share, residual = find_share(library, samples, values, slopes, 8 * ROUNDING)
    values = values[:, :, :n]
    if not (share < MOST_SHARE and np.linalg.eigvalsh(values[0])[0] > 0):
        return None
    k = share / (1 - share)
    return RiccatiSolution(
        problem=problem,
        horizon=T,
        periodic=True,
        series=FourierSeries(X.coefficients[:, :, :n].copy(), T),
        error=k + 8 * ROUNDING,
        gain_error=bound_gain_error(problem, t, values, k),
        method_error=k,
        residual=residual / (float(np.abs(values).max()) * max(rate, 1 / T)),
        symmetry=0.0,
        closure=0.0,
        doublings=0,
        segments=len(X.coefficients),
        status="converged",
    )


def evaluate_with_slopes(X: FourierSeries, t: Array) -> tuple[Array, Array]:
    """Return a series and its derivative at times t (N,)."""
    basis = fourier_basis(t / X.period, X.harmonics)
    shape = (len(t), *X.coefficients.shape[1:])
    values, slopes = (basis @ one.coefficients.reshape(len(one.coefficients), -1) for one in (X, X.derivative()))
    return values.reshape(shape), slopes.reshape(shape)


def bound_gain_error(problem: LinearQuadratic, t: Array, X: Array, k: float) -> float:
    """Return a bound on |K error| / max |K| of -k X <= E <= k X at times t, rounding added.

    K = R^-1 (B' X + N'),   |K error|_ij <= k sqrt((R^-1 B' X B R^-1)_ii X_jj)
    """
    effort = np.linalg.inv(take_once(problem.R(t)))
    to_gain = effort @ transpose(take_once(problem.B(t)))
    by_X = to_gain @ X
    reach = (by_X * to_gain).sum(axis=2).max(axis=1).clip(0.0)
    far = k * float(np.sqrt((reach * np.diagonal(X, axis1=1, axis2=2).max(axis=1)).max()))
    product = 8 * ROUNDING * float((np.abs(to_gain) @ np.abs(X)).max())
    gain = by_X + effort @ transpose(take_once(problem.N(t)))
    return (far + product) / (float(np.abs(gain).max()) or 1.0)
