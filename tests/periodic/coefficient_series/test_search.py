"""The search for pulses by one random sum of all entries: none hides, in whichever entries it is and however small these are."""

import numpy as np
import pytest

from flexlin.periodic import resolve
from tests.periodic.coefficient_series.functions import background, resolved
from tests.thinned import thin

T = 2.0


def waving(rng, n, spread):
    """Entries of n x n with a few harmonics each, of sizes that are `spread` decades apart, some of them constant and some zero."""
    size = 10.0 ** rng.uniform(-spread / 2, spread / 2, (n, n)) * (rng.random((n, n)) < 0.8)
    smooth = background(rng, T, n, 3)
    return (lambda t: size * smooth(t)), size


def box(t, begin, width):
    """One from `begin` on for a while."""
    return ((np.mod(t, T) >= begin) & (np.mod(t, T) < begin + width)).astype(float)[:, None, None]


@pytest.mark.parametrize("share", [1e-9, 1e-6, 1.0])
@pytest.mark.parametrize("spread", [0.0, 16.0])
@pytest.mark.parametrize("seed", thin(range(6), 3))
def test_a_pulse_in_one_entry_is_seen_beside_entries_of_any_size(seed, spread, share):
    rng = np.random.default_rng([seed, int(spread)])
    n = int(rng.integers(1, 7))
    A, size = waving(rng, n, spread)
    row, column = rng.integers(n, size=2)
    height = np.zeros((n, n))
    height[row, column] = share * (size[row, column] or 1e-12)
    width = 1.001e-4 * T * 10.0 ** rng.uniform(0, 1)
    begin = rng.uniform(0, T - width)
    series = resolve(lambda t: A(t) + height * box(t, begin, width), T)
    inside = [place.time for place in series.found if place.time > 0]
    assert inside == pytest.approx([begin, begin + width], abs=1e-14 * T + 1e-12 * T * (share < 1e-3))
    assert {place.kind for place in series.found} == {"jump"}


@pytest.mark.parametrize("pattern", ["skew", "rows", "trace", "rank one", "all"])
@pytest.mark.parametrize("seed", thin(range(4), 2))
def test_no_pattern_of_entries_cancels_in_the_sum(seed, pattern):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    A, _ = waving(rng, n, 4.0)
    column = rng.standard_normal(n)
    height = {
        "skew": np.triu(np.ones((n, n)), 1) - np.tril(np.ones((n, n)), -1),
        "rows": np.outer((-1.0) ** np.arange(n), np.ones(n)),
        "trace": np.diag((-1.0) ** np.arange(n)),
        "rank one": np.outer(column, rng.permutation(column)),
        "all": np.ones((n, n)),
    }[pattern]
    begin = rng.uniform(0, 0.9 * T)

    def pulsed(t):
        return A(t) + 1e-6 * height * box(t, begin, 2.5e-4)

    assert len([place for place in resolved(pulsed, T).found if place.time > 0]) == 2


@pytest.mark.parametrize("n", [2, 8, 20])
def test_a_smooth_function_is_asked_once_in_parts_that_stay_in_cache(n):
    A, _ = waving(np.random.default_rng(n), n, 2.0)
    asked = []

    def counted(t):
        asked.append(len(t))
        return A(t)

    series = resolve(counted, T)
    assert series.degree == 3
    assert sum(asked) == series.samples < 10_500
    assert 8 * n * n * max(asked[1:]) <= 1_000_000
    assert len(asked) < 90
