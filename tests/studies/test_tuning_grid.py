"""The study of tuning, small: not worse than two percent below the best of a grid, and stable on random scenarios."""

import pytest


@pytest.mark.slow
def test_tuning_grid(study):
    for found in study("tuning_grid").check_all(size="small").values():
        assert found["tuned"] <= 0.98 * found["grid"] < 0
        assert found["random"] <= 0.98 * found["tuned"] < 0
        assert found["tuned"] <= 2 * found["before"]
