"""Interpolation against calculus; angles and logarithms modulo 2 pi against arithmetic on the unit circle; one-to-one assignment."""

from itertools import permutations

import numpy as np
import pytest

from flexlin.periodic import (
    ChebyshevPanels,
    FourierSeries,
    assign,
    chebyshev_coefficients,
    circle_derivative,
    count_turns,
    fourier_nodes,
    match_logs,
    panel_times,
    wrap_angle,
)


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


T = 1.7


def waves(t):
    return np.exp(np.sin(2 * np.pi * t / T + 0.3))


def rate(t):
    return 2 * np.pi / T * np.cos(2 * np.pi * t / T + 0.3) * waves(t)


@pytest.mark.parametrize("count", [40, 41])
def test_waves_give_the_derivative_of_calculus(count):
    t = fourier_nodes(count, T)
    assert circle_derivative(waves(t), T) == pytest.approx(rate(t), abs=1e-11)


@pytest.mark.parametrize("value", [0.1, 1 / 3, 1e300, 1e-300])
def test_constants_come_back_bit_for_bit(value):
    series = FourierSeries.through(np.full((24, 1, 1), value), T)
    assert np.all(series.coefficients[1:] == 0)
    assert series.mean()[0, 0] == value
    coefficients = chebyshev_coefficients(np.full((1, 32, 1), value))
    assert coefficients[0, 0, 0] == value
    assert np.all(coefficients[0, 1:] == 0)


def test_panels_are_right_continuous_and_integrate_exactly():
    edges = np.array([0.0, 0.3, 1.1, T])
    t = panel_times(edges[:-1], edges[1:], 24)
    values = np.stack([np.exp(t) + 5 * np.arange(3)[:, None], np.cos(9 * t)], axis=2)
    panels = ChebyshevPanels(edges, chebyshev_coefficients(values).reshape(3, 24, 1, 2))
    ask = np.array([0.3, 1.1, 0.0, T, -0.2, T + 0.5])
    piece = np.array([1, 2, 0, 0, 2, 1])
    wrapped = np.array([0.3, 1.1, 0.0, 0.0, T - 0.2, 0.5])
    assert panels(ask)[:, 0, 0] == pytest.approx(np.exp(wrapped) + 5 * piece, abs=1e-13)
    before, until = np.array([0, 1, 2, 2, 2, 1]), np.array([0.3, 1.1, T, T, T - 0.2, 0.5])
    assert panels(ask, left=True)[:, 0, 0] == pytest.approx(np.exp(until) + 5 * before, abs=1e-13)
    inside = np.random.default_rng(4).uniform(0, T, 99)
    assert panels.derivative()(inside)[:, 0, 1] == pytest.approx(-9 * np.sin(9 * inside), abs=1e-10)
    whole = np.exp(T) - 1 + 5 * 0.8 + 10 * (T - 1.1)
    assert panels.mean()[0] == pytest.approx([whole / T, np.sin(9 * T) / 9 / T], abs=1e-13)


@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
def test_values_of_any_shape_and_their_derivatives(shape):
    rng = np.random.default_rng(5)
    weights, other = rng.standard_normal(shape), rng.uniform(-5, 5, 50)
    series = FourierSeries.through(np.multiply.outer(waves(fourier_nodes(64, T)), weights), T)
    second = (rate(other + 1e-4) - rate(other - 1e-4)) / 2e-4
    for derivative, (known, atol) in enumerate([(waves(other), 1e-12), (rate(other), 1e-10), (second, 1e-4)]):
        np.testing.assert_allclose(series(other, derivative), np.multiply.outer(known, weights), atol=atol)
        np.testing.assert_allclose(series(0.3, derivative), series(np.array([0.3]), derivative)[0])
    assert series(0.3).shape == shape
