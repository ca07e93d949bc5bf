"""Transition matrices of systems of second order by compiled code: what `second_order_transitions` computes, eight segments at a time."""

from functools import lru_cache

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.transition.gauss import (
    collocate_accelerations,
    fold_samples,
    gauss,
    place_nodes,
    second_order_transitions,
)

MOST_UNKNOWNS = 100
"""Stages times coordinates up to which the compiled code serves; LAPACK is as fast beyond."""
BLOCK_BYTES = 2**24
"""Samples that are taken at a time."""
FACTOR = declare(
    "int factor_accelerations(int m, int stages, int segments, const double *blocks, const double *lengths, const double *tableau, "
    "double *Phi, int *good)",
    lambda m, s, K, *_: ((K, s, m, 3 * m), (K,), 2 * s * (s + 1), (K, 2 * m, 2 * m), (K,)),
)


def companion_transitions(coefficients: ResolvedCompanion, edges: Array, stages: int) -> Array:
    """As `second_order_transitions`, (K, 2n, 2n). Raises: SingularMassMatrix, MemoryError."""
    n = coefficients.blocks.shape[0]
    if stages * n > MOST_UNKNOWNS:
        return second_order_transitions(coefficients.sample, edges, stages)
    h, t = np.diff(edges), place_nodes(edges, gauss(stages).c)
    Phi, good = np.empty((len(h), 2 * n, 2 * n)), np.empty(len(h), np.intc)
    size = max(8, BLOCK_BYTES // (24 * stages * n * n))
    for i in range(0, len(h), size):
        part = slice(i, i + size)
        blocks = np.ascontiguousarray(fold_samples(coefficients.blocks(t[part].ravel()), t[part]))
        if not FACTOR(n, stages, len(blocks), blocks, h[part], tabulate_rule(stages), Phi[part], good[part]):
            raise MemoryError("the stages of a segment")
        lost = np.flatnonzero(good[part] == 0)
        if len(lost):
            M, D, K = coefficients.split(blocks[lost])
            Phi[part][lost] = collocate_accelerations(M, D, K, h[part][lost], gauss(stages))
    return Phi


@lru_cache(maxsize=16)
def tabulate_rule(stages: int) -> Array:
    """Gauss' rule in one row: c, a, a a, b."""
    rule = gauss(stages)
    return np.concatenate([part.ravel() for part in (rule.c, rule.a, rule.a @ rule.a, rule.b)])
