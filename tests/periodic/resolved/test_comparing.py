"""Deviations of series and sizes of samples, against sums written out."""

import numpy as np
import pytest

from flexlin.periodic.resolved import comparing, sampling, sizes
from flexlin.periodic.resolved.sampling import CheckPoints, Sampler, usual_phases


@pytest.mark.parametrize(
    ("rows", "columns", "harmonics"), [(1, 1, 0), (1, 7, 3), (2, 4, 1), (3, 3, 40), (1, 17, 2), (5, 5, 1)]
)
def test_the_largest_deviation_wherever_it_is(monkeypatch, rows, columns, harmonics):
    rng = np.random.default_rng([rows, columns])
    entries, T, count = rows * columns, 3.7, len(usual_phases())
    series = rng.standard_normal((2 * harmonics + 1, entries)) * (rng.random(entries) < 0.5)
    series[0] = rng.standard_normal(entries)
    angle = 2 * np.pi * np.outer(usual_phases(), np.arange(1, harmonics + 1))
    exact = series[0] + np.concatenate([np.cos(angle), np.sin(angle)], axis=1) @ series[1:]
    off, where = rng.standard_normal(entries), rng.integers(0, count, entries)
    where[:2] = (0, count - 1)[: len(where)]  # the first and the last time too
    exact[where, np.arange(entries)] += off
    times = T * usual_phases()

    def A(t):
        return exact[np.searchsorted(times, t)].reshape(-1, rows, columns)

    sample = Sampler(A, T)
    sample(times[:1])
    monkeypatch.setattr(sampling, "BATCH", int(rng.integers(3000, 300_000)))
    checks = CheckPoints(sample, times, usual=True)
    for _ in range(3):  # as it comes, then kept
        np.testing.assert_allclose(comparing.find_deviation(series, checks), np.abs(off), rtol=0, atol=1e-12)
    assert sample.count == 2 * count + 1
    np.testing.assert_array_equal(sample.scale, np.abs(exact).max(axis=0))


@pytest.mark.parametrize("columns", [1, 3, 8, 21])
def test_the_largest_sizes_and_what_is_no_number(columns):
    rng = np.random.default_rng(columns)
    rows = rng.standard_normal((8192 // columns + 5, columns)) * 10.0 ** rng.uniform(-300, 300, columns)
    np.testing.assert_array_equal(sizes.largest_sizes(rows), np.abs(rows).max(axis=0))
    for bad in (np.nan, np.inf, -np.inf):
        other = rows.copy()
        other[rng.integers(len(rows)), rng.integers(columns)] = bad
        assert not np.isfinite(sizes.largest_sizes(other)).any()
