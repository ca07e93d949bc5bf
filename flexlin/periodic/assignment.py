"""The cheapest one-to-one assignment of rows to columns."""

import numpy as np

from flexlin.checks import Array


def assign(cost: Array) -> Array:
    """The column of each row (n,) such that the sum of the costs (n, m), n <= m, is least.

    Where the rows' cheapest columns differ from each other they are the answer; the Hungarian algorithm is loaded only otherwise.
    """
    cheapest = cost.argmin(axis=1)
    if np.isfinite(cost).all() and len(set(cheapest.tolist())) == len(cost):
        return np.asarray(cheapest)
    from scipy.optimize import linear_sum_assignment  # takes longer to load than most spectra to compute

    return np.asarray(linear_sum_assignment(cost)[1])
