"""One-to-one assignment against all permutations."""

from itertools import permutations

import numpy as np
import pytest

from flexlin.periodic import assign


@pytest.mark.parametrize("whole", [False, True], ids=["real", "with ties"])
def test_no_permutation_costs_less(whole):
    rng = np.random.default_rng(2)
    for _ in range(60):
        rows = int(rng.integers(1, 6))
        cost = rng.random((rows, rows + rng.integers(0, 3))) ** rng.integers(1, 9) - rng.integers(0, 2)
        cost += rng.integers(0, 2) * rng.random(cost.shape[1]) * 3  # columns that all rows want
        cost = np.round(4 * cost) if whole else cost
        column = assign(cost)
        assert len(set(column.tolist())) == rows
        best = min(cost[np.arange(rows), list(one)].sum() for one in permutations(range(cost.shape[1]), rows))
        np.testing.assert_allclose(cost[np.arange(rows), column].sum(), best, rtol=1e-13, atol=1e-13)


def test_infinite_costs_are_avoided():
    assert assign(np.array([[0.0, 1.0], [0.0, np.inf]])).tolist() == [1, 0]
