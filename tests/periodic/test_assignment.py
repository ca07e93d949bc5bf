"""One-to-one assignment against SciPy's."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from flexlin.periodic.assignment import assign


def test_assignments_cost_as_little_as_scipy_s():
    rng = np.random.default_rng(2)
    for _ in range(200):
        rows = rng.integers(1, 7)
        cost = rng.random((rows, rows + rng.integers(0, 3))) ** rng.integers(1, 9)
        column = assign(cost)
        assert len(set(column.tolist())) == rows
        best = cost[linear_sum_assignment(cost)].sum()
        np.testing.assert_allclose(cost[np.arange(rows), column].sum(), best, rtol=1e-14)
