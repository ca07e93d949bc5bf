"""What a loop makes of the residual of its Riccati solution: a bound on the error by one Lyapunov equation, solved like Riccati's."""

from dataclasses import replace
from math import sqrt

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.quadratic.backward import compare_with_equation, correct_until_closed, reach_inputs
from flexlin.periodic.quadratic.evidence import ROUNDING, weigh
from flexlin.periodic.quadratic.samples import RiccatiSampler, divide_parts, join_parts
from flexlin.periodic.quadratic.triangle import evaluate_triangle, triangle_places

LEAST, CLOSE = 96, 1e-4
"""Nodes at the least, and the change of D, relative to itself, with which it is known."""
MOST_SHARE, MOST_CURVED = 0.5, 0.2
"""Largest share of W that D's own residual may be, and largest q."""
SEEN = 1e-3
"""Waves of D below this part of its mean need not be seen."""


def carry_residual(sampler: RiccatiSampler, X: Array, sizes: Array, rate: float) -> tuple[float, float] | None:
    """Bound what a residual F makes of X and of the gain; None where it is not solved, or D proves nothing.

        -D' = Ac' D + D Ac + W + G,   Ac = A - S X,   -W <= F <= W,   -r W <= G <= r W,   D > 0 at one time

    G is what is left over of D's own equation. With D1 = D / (1 - r), by Lyapunov's theorem the loop Ac is stable. An error E of X
    obeys Lyapunov's equation with the right side F - E S E; with q = max tr(S D1) tr(W^-1 D1) < 1/4 the map from E to its solution keeps

        -k D1 <= E <= k D1,   |E_ij| <= k sqrt(D1_ii D1_jj),   k = 2 / (1 + sqrt(1 - 4 q))

    Parameters: X: a series; sizes (n (n + 1) / 2,): of F's entries at all times; rate: the Hamiltonian's spectral radius.
    Returns: the bounds on the largest entry of E, and on the largest sqrt((R^-1 B' |E| B R^-1)_ii |E|_jj).
    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov equation and inequality).
    """
    library, period = sampler.library, sampler.period
    count = 32 * int(np.ceil(max(2 * len(X), LEAST) / 32))
    samples, where = sampler.sample(2 * count), triangle_places(X.shape[1])
    values, B = evaluate_triangle(X, 2 * count)[:, where], samples.B
    A = join_parts(samples.A if len(samples.A) > 1 else samples.A[:, :, :1]).reshape(-1, *where.shape)
    by = samples.effort @ np.swapaxes(B, 1, 2)
    loop, W = A - B @ (by @ values), weigh(sizes[where][None], values)
    linear = replace(
        samples, A=divide_parts(loop), S=np.zeros_like(samples.S[:1]), Q=divide_parts(np.diag(W)[None], True)
    )
    D = correct_until_closed(library, linear, period, rate, CLOSE, tol=SEEN)
    if D is None:
        return None
    share = compare_with_equation(library, linear, period, D.series, D.every, 8 * ROUNDING).share
    if not share <= MOST_SHARE:
        return None
    at = evaluate_triangle(D.series, 2 * count)[:, where] / (1 - share)
    effect = np.einsum("tij,tji->t", B @ by, at) * (np.diagonal(at, axis1=1, axis2=2) / W).sum(axis=1)
    q = float(effect.max())
    if not q <= MOST_CURVED:
        return None
    k = 2 / ((1 + sqrt(1 - 4 * q)) * (1 - share))
    most = float(D.values[:, np.diag(where)].max())
    return k * most, k * sqrt(reach_inputs(library, linear, D.values))
