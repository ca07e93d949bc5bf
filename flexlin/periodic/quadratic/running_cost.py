"""A bound on the error of a Riccati solution from its residual alone: X is a Lyapunov function that decays by the running cost."""

from math import sqrt

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.backward import compare_with_equation
from flexlin.periodic.quadratic.carrying import carry_residual
from flexlin.periodic.quadratic.evidence import ROUNDING
from flexlin.periodic.quadratic.samples import RiccatiSampler, RiccatiSamples
from flexlin.periodic.quadratic.solution import RiccatiSolution
from flexlin.periodic.quadratic.triangle import unfold_triangle

MOST_SHARE = 0.5
"""Largest r up to which the bound is used."""


def judge_by_cost(
    sampler: RiccatiSampler, samples: RiccatiSamples, X: Array, every: int, rate: float, tol: float
) -> RiccatiSolution | None:
    """Put the solution together with a bound on its error; None where its residual proves none.

        F = X' + A' X + X A - X S X + Q,   C = Q + X S X,   -r C <= F <= r C,   r < 1,   X > 0 at one time

    Then X' + Ac' X + X Ac = F - C <= -(1 - r) C, so the loop Ac = A - S X is stable where C > 0; the residual of X / (1 - r) is
    negative, that of (1 - r) X positive, and the stabilising solution lies between these two:

        |E_ij| <= k sqrt(X_ii X_jj),   k = r / (1 - r)

    Where that misses tol, or C is singular, what the loop makes of F is looked at (`carry_residual`). Assumes that F is smooth between the
    times at which it is looked at.
    With them  |K error|_ij <= k sqrt((R^-1 B' X B R^-1)_ii X_jj),  K = R^-1 (B' X + N').
    Source: Bittanti, Colaneri, De Nicolao, The periodic Riccati equation, in The Riccati Equation (1991), ch. 6 (comparison).

    Parameters: X: a series (`unfold_triangle`) through every so many nodes, of which each second of the samples is one; rate: the
    Hamiltonian's spectral radius.
    """
    compared = compare_with_equation(sampler.library, samples, sampler.period, X, every, 8 * ROUNDING)
    k = compared.share / (1 - compared.share) if compared.share < MOST_SHARE else np.inf
    gain, series = compared.gain or 1.0, unfold_triangle(X, sampler.period)
    error, far = k, k * sqrt(compared.reach)
    if k == np.inf or max(error, far / gain) + 8 * ROUNDING > tol:
        carried = carry_residual(sampler, X, compared.sizes, rate)
        if carried is not None:
            error, far = min(error, carried[0] / compared.size), min(far, carried[1])
    if error == np.inf:
        return None
    return RiccatiSolution(
        problem=sampler.problem,
        horizon=sampler.period,
        periodic=True,
        series=series,
        error=float(error + 8 * ROUNDING),
        gain_error=float((far + 8 * ROUNDING * compared.product) / gain),
        method_error=float(error),
        residual=compared.residual / (compared.size * max(rate, 1 / sampler.period)),
        symmetry=0.0,
        closure=0.0,
        doublings=0,
        segments=len(series.coefficients),
        status="converged",
    )
