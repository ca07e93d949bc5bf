"""The cheapest one-to-one assignment of rows to columns."""

import numpy as np

from flexlin.checks import Array


def assign(cost: Array) -> Array:
    """The column of each row (n,) such that the sum of the costs (n, m), n <= m, is least.

    Each row takes its cheapest column; where that does not do, SciPy's C++ assigns (csgraph, which loads faster than scipy.optimize).
    """
    cheapest = cost.argmin(axis=1)
    if len(np.unique(cheapest)) == len(cost):
        return cheapest
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    least = np.finfo(float).tiny  # an edge of no weight would be none
    rows, columns = np.nonzero(np.isfinite(cost))
    weights = (cost - cost[rows, columns].min())[rows, columns] + least
    return np.asarray(min_weight_full_bipartite_matching(csr_array((weights, (rows, columns)), shape=cost.shape))[1])
