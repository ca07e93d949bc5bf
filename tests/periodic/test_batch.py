import tracemalloc

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ArgumentError
from flexlin.periodic import floquet_batch
from tests.periodic.systems import lyapunov_transformed, mathieu_second_order


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def mathieu_samples(values, t):
    """M, D, K of x'' + 0.01 x' + (a - 2 q cos 2t) x = 0 for values (a, q)."""
    a, q = values[:, :1], values[:, 1:]
    K = (a - 2 * q * np.cos(2 * t))[..., None, None]
    return np.ones_like(K), 0.01 * np.ones_like(K), K


def test_stability_chart_agrees_with_floquet(rng):
    values = np.column_stack([rng.uniform(0.2, 9, 120), rng.uniform(0, 3, 120)])
    result = floquet_batch(mathieu_samples, values, np.pi, tol=1e-8)
    for i, (a, q) in enumerate(values):
        system = mathieu_second_order(a, q)
        second = system.second_order
        damped = fl.PeriodicSystem.from_second_order(second.M, 0.01 * np.eye(1), second.K, np.pi)
        single = fl.floquet(damped, tol=1e-11)
        assert abs(single.exponents[0].real - result.growth[i]) <= min(result.growth_error[i] + single.error, 1e-8)
        expected = {"stable": -1, "unstable": 1, "undecided": 0}[single.verdict]
        assert result.verdict[i] in (expected, 0)
    assert result.one_by_one < 12


def test_first_order_samples_and_one_period_for_each_value(rng):
    """Time scaled by 1 / w scales the exponents by w."""
    A = lyapunov_transformed(np.array([[-0.3, 2.0], [-2.0, -0.3]]), 1.0, 1, rng)
    w = np.array([0.5, 1.0, 3.0])

    def sample(values, t):
        return values[:, None, None, None] * A((values[:, None] * t).ravel()).reshape(*t.shape, 2, 2)

    result = floquet_batch(sample, w, 2 * np.pi / w)
    np.testing.assert_allclose(result.growth, -0.3 * w, atol=1e-8)


def test_stiff_values_fall_back_and_stay_right():
    """Exponents -0.1 and -rate: the fast one is certified or computed one by one, the growth is right in either case."""
    rate = np.array([1.0, 30.0, 300.0, 3000.0])
    turn = np.array([[1.0, 0.2], [-0.3, 1.0]])

    def sample(values, t):
        constant = np.zeros((len(values), 2, 2))
        constant[:, 0, 0], constant[:, 1, 1] = -0.1, -values
        return np.broadcast_to((turn @ constant @ np.linalg.inv(turn))[:, None], (*t.shape, 2, 2))

    result = floquet_batch(sample, rate, 2.0)
    np.testing.assert_allclose(result.growth, -0.1, atol=1e-8)
    assert np.all(np.abs(result.growth + 0.1) <= result.growth_error)
    assert np.all(result.verdict == -1)


def test_jump_in_the_coefficients():
    def sample(values, t):
        A = np.zeros((*t.shape, 2, 2))
        A[..., 0, 1] = 1
        A[..., 1, 0] = -(1 - values[:, None] * np.where(t < np.pi / 3, 1, -1))
        return A

    result = floquet_batch(sample, np.array([0.2]), np.pi, breaks=(1 / 3,))
    assert abs(result.growth[0] - 0.04137974466122074514) < 1e-9  # Meissner's equation


def test_memory_does_not_grow_with_the_batch():
    def peak(count):
        values = np.tile([[1.0, 0.2]], (count, 1))
        tracemalloc.start()
        floquet_batch(mathieu_samples, values, np.pi)
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    small, large = peak(500), peak(4000)
    assert large - small < 3500 * 300  # only the results: two arrays of n numbers, their copies, and the growth's error


def test_bad_batches_are_refused():
    with pytest.raises(ArgumentError, match="period"):
        floquet_batch(mathieu_samples, np.ones((2, 2)), [1.0, -1.0])
    with pytest.raises(ArgumentError, match="nothing"):
        floquet_batch(mathieu_samples, np.ones((0, 2)), 1.0)
