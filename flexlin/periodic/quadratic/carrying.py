"""What a loop makes of the residual of its Riccati solution: a bound on the error by one Lyapunov equation, swept like Riccati's."""

from dataclasses import replace
from math import sqrt

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.backward import Level, reach_inputs, sweep_until_closed
from flexlin.periodic.quadratic.evidence import weigh
from flexlin.periodic.quadratic.samples import RiccatiSampler, divide_parts, join_parts
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

    Parameters: X: a series; sizes (n (n + 1) / 2,): of F's entries at all times; rate: the Hamiltonian's spectral radius.
    Returns: the largest entry of D, and the largest sqrt((R^-1 B' D B R^-1)_ii D_jj).
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov equation).
    """
    count = 16 * int(np.ceil(max(rate * sampler.period / REACH, len(X), LEAST) / 16))
    samples, where = sampler.sample(2 * count), triangle_places(X.shape[1])
    values, B = evaluate_triangle(X, 2 * count)[:, where], samples.B
    A = join_parts(samples.A if len(samples.A) > 1 else samples.A[:, :, :1]).reshape(-1, *where.shape)
    loop = A - B @ (samples.effort @ np.swapaxes(B, 1, 2) @ values)
    W = np.diag(weigh(sizes[where][None], values))[None]
    linear = replace(samples, A=divide_parts(loop), S=np.zeros_like(samples.S[:1]), Q=divide_parts(W, True))
    D = sweep_until_closed(sampler.library, linear, sampler.period, (LEVEL,))
    if D is None:
        return None
    most = float(D.values[:, np.diag(where)].max())
    return SLACK * most, SLACK * sqrt(reach_inputs(sampler.library, linear, D.values))
