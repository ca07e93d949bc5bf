"""Angles and logarithms modulo 2 pi against arithmetic on the unit circle, borders and digits included; and one-to-one assignment."""

from itertools import permutations

import numpy as np
import pytest

from flexlin.periodic import assign, count_turns, match_logs, wrap_angle


def test_wrapped_angles_are_on_the_same_point_of_the_circle_inside_the_half_open_interval():
    odd = np.pi * np.array([-3.0, -1.0, 1.0, 3.0])  # they belong to plus pi
    borders = odd, np.nextafter(odd, 9), np.nextafter(odd, -9)
    angle = np.concatenate([np.random.default_rng(1).uniform(-300, 300, 2000), *borders])
    near = wrap_angle(angle)
    np.testing.assert_allclose(np.exp(1j * near), np.exp(1j * angle), atol=1e-13)
    assert np.all((near > -np.pi) & (near <= np.pi))
    turns = 2 * np.pi * count_turns(angle[:2000])
    np.testing.assert_allclose((angle - near)[:2000], turns, atol=1e-13)
    small = np.array([1e-300, -1e-17, 3e-9, -3.0, 3.0])
    np.testing.assert_array_equal(wrap_angle(small), small)  # they keep all their digits


@pytest.mark.parametrize("seed", range(3))
def test_a_shuffled_set_finds_itself_again(seed):
    rng = np.random.default_rng(seed)
    logs = rng.standard_normal(7) + 1j * rng.uniform(-np.pi, np.pi, 7)
    logs[1] = logs[0]
    moved = 1e-9 * (rng.standard_normal(7) + 1j * rng.standard_normal(7))
    others = (logs + moved)[rng.permutation(7)] + 2j * np.pi * rng.integers(-3, 4, 7)
    partner, distance = match_logs(logs, others)
    assert sorted(partner) == list(range(7))
    np.testing.assert_allclose(np.exp(others[partner]), np.exp(logs), rtol=1e-7)
    assert distance.max() < 1e-8


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
    assert assign(np.array([[0.0, 1.0], [0.0, np.inf]])).tolist() == [1, 0]
