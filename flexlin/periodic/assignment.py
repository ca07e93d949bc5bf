"""The cheapest one-to-one assignment of rows to columns."""

import numpy as np

from flexlin.checks import Array


def assign(cost: Array) -> Array:
    """The column of each row (n,) such that the sum of the costs (n, m), n <= m, is least.

    Each row takes its cheapest column; where that does not do, SciPy assigns by shortest augmenting paths. Its sparse matching, which
    loads faster, may turn in a circle for ever where differences of costs are lost in rounding.
    """
    cheapest = cost.argmin(axis=1)
    if len(np.unique(cheapest)) == len(cost):
        return cheapest
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(np.where(np.isfinite(cost), cost, np.inf))[1])
