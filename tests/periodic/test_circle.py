"""Angles and logarithms modulo 2 pi against arithmetic on the unit circle, borders and digits included; and one-to-one assignment."""

from itertools import permutations

import numpy as np
import pytest

from flexlin.periodic import assign, count_turns, match_logs, measure_distances, wrap_angle, wrap_log


def test_wrapped_angles_are_on_the_same_point_of_the_circle_inside_the_half_open_interval():
    angle = np.random.default_rng(1).uniform(-300, 300, 2000)
    near = wrap_angle(angle)
    np.testing.assert_allclose(np.exp(1j * near), np.exp(1j * angle), atol=1e-13)
    assert np.all((near > -np.pi) & (near <= np.pi))
    np.testing.assert_allclose(angle - near, 2 * np.pi * count_turns(angle), atol=1e-13)


def test_borders_belong_to_plus_pi():
    odd = np.pi * np.array([-3.0, -1.0, 1.0, 3.0])
    np.testing.assert_allclose(wrap_angle(odd), np.pi, atol=1e-15)
    ulps = np.concatenate([np.nextafter(odd, 9), np.nextafter(odd, -9), odd])
    near = wrap_angle(ulps)
    assert np.all((near > -np.pi) & (near <= np.pi))


def test_small_angles_keep_all_their_digits():
    angle = np.array([1e-300, -1e-17, 3e-9, -3.0, 3.0])
    np.testing.assert_array_equal(wrap_angle(angle), angle)
    log = np.array([1e-20 + 1e-19j, 5.0 - 3.0j])
    np.testing.assert_array_equal(wrap_log(log), log)


@pytest.mark.parametrize("seed", range(8))
def test_a_shuffled_set_finds_itself_again(seed):
    rng = np.random.default_rng(seed)
    logs = rng.standard_normal(7) + 1j * rng.uniform(-np.pi, np.pi, 7)
    logs[1] = logs[0]
    order = rng.permutation(7)
    moved = 1e-9 * (rng.standard_normal(7) + 1j * rng.standard_normal(7))
    others = (logs + moved)[order] + 2j * np.pi * rng.integers(-3, 4, 7)
    partner, distance = match_logs(logs, others)
    assert sorted(partner) == list(range(7))
    np.testing.assert_allclose(np.exp(others[partner]), np.exp(logs), rtol=1e-7)
    assert distance.max() < 1e-8


def test_nearest_pairs_come_first():
    logs, others = np.array([0.0, 1.0 + 0j]), np.array([0.9 + 0j, 5.0])
    partner, distance = match_logs(logs, others)
    np.testing.assert_array_equal(partner, [1, 0])
    np.testing.assert_allclose(distance, [5.0, 0.1])


def test_distances_cross_the_cut():
    assert measure_distances(np.array([1 + 3.1j]), np.array([1 - 3.1j]))[0, 0] == pytest.approx(2 * np.pi - 6.2)


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
