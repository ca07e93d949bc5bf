"""One-to-one assignment against SciPy's."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from flexlin.periodic.assignment import assign


@pytest.mark.parametrize("whole", [False, True], ids=["real", "with ties"])
def test_assignments_cost_as_little_as_scipy_s(whole):
    rng = np.random.default_rng(2)
    for _ in range(100):
        rows = rng.integers(1, 25)
        cost = rng.random((rows, rows + rng.integers(0, 3))) ** rng.integers(1, 9) - rng.integers(0, 2)
        cost += rng.integers(0, 2) * rng.random(cost.shape[1]) * 3  # columns that all rows want
        cost = np.round(4 * cost) if whole else cost
        column = assign(cost)
        assert len(set(column.tolist())) == rows
        best = cost[linear_sum_assignment(cost)].sum()
        np.testing.assert_allclose(cost[np.arange(rows), column].sum(), best, rtol=1e-13, atol=1e-13)


def test_infinite_costs_are_avoided():
    assert assign(np.array([[0.0, 1.0], [0.0, np.inf]])).tolist() == [1, 0]
