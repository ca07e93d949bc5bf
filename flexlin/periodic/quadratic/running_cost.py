"""A bound on the error of a Riccati solution from its residual alone: X is a Lyapunov function that decays by the running cost."""

import ctypes

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.quadratic.backward import RiccatiSamples, find_share
from flexlin.periodic.quadratic.evidence import ROUNDING
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, take_once
from flexlin.periodic.quadratic.scattering import transpose
from flexlin.periodic.quadratic.solution import RiccatiSolution

MOST_SHARE = 0.5
"""Largest r up to which the bound is used."""
SEEN = 32
"""Times at which the sizes of X and of the gain are looked at."""


def judge_by_cost(
    problem: LinearQuadratic, library: ctypes.CDLL, samples: RiccatiSamples, X: FourierSeries, rate: float
) -> RiccatiSolution | None:
    """Put the solution together with a bound on its error; None where its residual is not small against the running cost.

        F = X' + A' X + X A - X S X + Q,   C = Q + X S X,   -r C <= F <= r C,   r < 1,   X > 0 at one time

    Then X' + Ac' X + X Ac = F - C <= -(1 - r) C, so the loop Ac = A - S X is stable where C > 0; the residual of X / (1 - r) is
    negative, that of (1 - r) X positive, and the stabilising solution lies between these two:

        |E_ij| <= k sqrt(X_ii X_jj),   k = r / (1 - r)

    Assumes that F is smooth between the times at which it is compared with C.
    Source: Bittanti, Colaneri, De Nicolao, The periodic Riccati equation, in The Riccati Equation (1991), ch. 6 (comparison).

    Parameters: samples: the coefficients at equally spaced nodes; X (n, w), rows filled up with zeros, made of its values at the even ones;
    it is judged at the odd ones. rate: the Hamiltonian's spectral radius.
    """
    count, T = samples.count // 2, X.period
    n = X.coefficients.shape[1]
    values, slopes = evaluate_between(X, count)
    share, residual = find_share(library, samples.every(2, 1), values, slopes, 8 * ROUNDING)
    values = values[:, :, :n]
    if not (share < MOST_SHARE and np.linalg.eigvalsh(values[0])[0] > 0):
        return None
    k, few = share / (1 - share), slice(None, None, count // SEEN)
    t = fourier_nodes(count, T)[few] + T / (2 * count)
    return RiccatiSolution(
        problem=problem,
        horizon=T,
        periodic=True,
        series=FourierSeries(X.coefficients[:, :, :n].copy(), T),
        error=float(k + 8 * ROUNDING),
        gain_error=bound_gain_error(problem, t, values[few], k),
        method_error=k,
        residual=residual / (float(np.abs(values).max()) * max(rate, 1 / T)),
        symmetry=0.0,
        closure=0.0,
        doublings=0,
        segments=len(X.coefficients),
        status="converged",
    )


def evaluate_between(X: FourierSeries, count: int) -> tuple[Array, Array]:
    """Return a series and its derivative half-way between N equally spaced nodes, more than it has coefficients: (N, rows, columns)."""
    H, flat = X.harmonics, X.coefficients.reshape(len(X.coefficients), -1)
    spectrum = np.zeros((2, count // 2 + 1, flat.shape[1]), complex)
    waves = np.arange(1, H + 1)[:, None]
    spectrum[0, 0] = count * flat[0]
    spectrum[0, 1 : H + 1] = (0.5 * count * np.exp(1j * np.pi / count * waves)) * (flat[1 : H + 1] - 1j * flat[H + 1 :])
    spectrum[1, 1 : H + 1] = (2j * np.pi / X.period * waves) * spectrum[0, 1 : H + 1]
    values, slopes = np.fft.irfft(spectrum, count, axis=1).reshape(2, count, *X.coefficients.shape[1:])
    return values, slopes


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
