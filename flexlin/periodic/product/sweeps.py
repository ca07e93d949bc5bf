"""Cyclic QR sweeps: orthogonal iteration on a long product, from its factors, until only clusters of near moduli are left."""

from itertools import pairwise

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.periodic.product.balancing import multiply_pairs

CLEAN = 1e-14
"""A cut between two groups of moduli is clean when the coupling below it is this small (times n)."""
SPREAD = 4.6
"""The logs of moduli inside one multiplied-out cluster may differ by this much: log 100, so two digits are lost."""
MIN_SWEEPS, MAX_SWEEPS, MAX_WORK = 12, 400, 8_000_000
"""Bounds on the sweeps, and on n^2 times the number of QR factorizations in all of them together."""
FULL_SWEEPS, GRADED = 2, 200.0
"""Sweeps over all factors before triangular ones are multiplied together, and the range of logs of a product's diagonal."""
SWEEP = declare(
    "void sweep_factors(int n, int count, int all, const double *factors, double *Q, double *R)",
    lambda n, count, every, *_: ((count, n, n), (count + 1 if every else 2, n, n), (count, n, n)),
)
EPS, TINY = float(np.finfo(float).eps), float(np.finfo(float).tiny)


def triangularize(factors: Array, Q: Array, clean: float) -> tuple[Array, Array, int, Array]:
    """Sweep until every cluster is narrow; the width that is accepted rises slowly so that equal gaps end too.

    After FULL_SWEEPS the rows of R are graded: then triangular factors may be multiplied together without loss, and the
    sweeps go on over W and these few products.
    """
    n, base, limit = factors.shape[-1], np.eye(len(Q)), MAX_SWEEPS
    for sweep in range(1, MAX_SWEEPS + 1):
        end, R = sweep_factors(factors, Q)
        W = Q.T @ end
        if find_clusters(W, R, clean * n)[2] <= SPREAD + sweep / 20 or sweep == limit:
            break
        if sweep == FULL_SWEEPS:
            base, Q, factors = Q, np.eye(n), np.concatenate([group_triangular(R), W[None]])
            end = W
            limit = max(MIN_SWEEPS, min(MAX_SWEEPS, MAX_WORK // (n * n * len(factors))))
        Q = end
    return W, R, sweep, base @ Q


def group_triangular(R: Array) -> Array:
    """Multiply neighbouring upper triangular factors while the logs of their diagonals stay below GRADED."""
    size = np.log(np.maximum(np.abs(np.diagonal(R, axis1=-2, axis2=-1)), TINY))
    while len(R) > 1:
        size = size[:-1:2] + size[1::2] if len(size) % 2 == 0 else np.concatenate([size[:-1:2] + size[1::2], size[-1:]])
        if np.abs(size).max() > GRADED:
            break
        R = multiply_pairs(R)
    return R


def sweep_factors(factors: Array, Q: Array, keep: bool = False) -> tuple[Array, Array]:
    """One sweep F_k Q_k = Q_(k+1) R_k; returns Q_K, or all Q_k (K + 1, n, n) where they are to be kept, and all R_k (K, n, n)."""
    (count, n, _), factors = factors.shape, np.ascontiguousarray(factors)
    bases, R = np.empty((count + 1 if keep else 2, n, n)), np.empty_like(factors)
    bases[0] = Q
    SWEEP(n, count, keep, factors, bases, R)
    return (bases if keep else bases[count % 2]), R


def find_clusters(W: Array, R: Array, clean: float) -> tuple[list[int], float, float]:
    """Cut where W is decoupled: the bounds of the clusters, the coupling that is dropped, the widest spread of log moduli."""
    below = np.maximum.accumulate(np.maximum.accumulate(np.abs(W)[::-1])[::-1], axis=1)
    coupling = [0.0, *np.diagonal(below, offset=-1).tolist(), 0.0]
    cuts = [i for i, value in enumerate(coupling) if value <= clean]
    size = sum_log_moduli(R).tolist()
    spread = max(max(size[a:b]) - min(size[a:b]) for a, b in pairwise(cuts))
    return cuts, max(coupling[i] for i in cuts), spread


def sum_log_moduli(R: Array) -> Array:
    """Sum of log |r_ii| over the factors; a zero counts as the smallest number."""
    diagonal = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    return np.log(np.maximum(diagonal, TINY)).sum(axis=0)
