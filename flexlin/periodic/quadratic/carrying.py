"""What a loop makes of the residual of its Riccati solution: a bound on the error by one Lyapunov equation, swept like Riccati's."""

from dataclasses import replace
from math import sqrt

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.backward import Level, RiccatiSampler, bound_gain, sweep_until_closed
from flexlin.periodic.quadratic.evidence import weigh
from flexlin.periodic.quadratic.triangle import evaluate_triangle, triangle_places

LEVEL = Level(1, 4, 1e-2)
REACH = 0.2
"""The largest product of a step and the Hamiltonian's spectral radius here."""
LEAST = 64
SLACK = 1.1
"""Factor for what the sweeps miss."""


def carry_residual(sampler: RiccatiSampler, X: Array, sizes: Array, rate: float) -> tuple[float, float] | None:
    """Bound what a residual F makes of X and of the gain, to first order; None where the sweeps do not close.

        -D' = Ac' D + D Ac + W,   -W <= F <= W,   -D <= E <= D,   |E_ij| <= sqrt(D_ii D_jj)

    Ac = A - S X is stable (`judge_by_cost`), so a larger right side has a larger solution. The term of second order, E S E <= k^2 X S X
    with -k X <= E <= k X, adds at most k^2 X.

    Parameters: X: amplitudes; sizes (n (n + 1) / 2,): of F's entries at all times; rate: the Hamiltonian's spectral radius.
    Returns: the largest entry of D, and the largest sqrt((R^-1 B' D B R^-1)_ii D_jj).
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov equation).
    """
    count = 16 * int(np.ceil(max(rate * sampler.period / REACH, 2 * X.shape[1], LEAST) / 16))
    samples, where = sampler.sample(count), triangle_places(len(X))
    n = len(where)
    values = evaluate_triangle(X, count).T[:, where]
    W = np.zeros((1, *samples.A.shape[1:]))
    W[0, :, :n] = 0.5 * np.diag(weigh(sizes[where][None], values))
    loop = samples.A + 2 * samples.S @ np.pad(
        values, ((0, 0), (0, samples.S.shape[2] - n), (0, samples.S.shape[2] - n))
    )
    linear = replace(samples, A=loop, S=np.zeros_like(W), Q=W)
    D = sweep_until_closed(sampler.library, linear, sampler.period, (LEVEL,), None)
    if D is None:
        return None
    most = float(D[np.diag(where)].max())
    reach, _, _ = bound_gain(sampler.library, linear, D, 1)
    return SLACK * most, SLACK * sqrt(reach)
