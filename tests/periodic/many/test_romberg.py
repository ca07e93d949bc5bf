"""Exponents of many systems at once, against closed forms, SciPy's Mathieu functions and the engine for one system."""

from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.many.romberg import balance_states, batched_exponents, exponentiate_segments
from flexlin.periodic.system import PeriodicSystem


def constant(X, Y):
    return lambda phases: (np.broadcast_to(X, (len(phases), *X.shape)), np.broadcast_to(Y, (len(phases), *Y.shape)))


def test_constant_coefficients_with_moduli_down_to_1e_minus_400():
    """y'' + (a + b) y' + a b y = 0 has the exponents -a, -b."""
    a, b = np.array([0.5, 3.0, 900.0]), np.array([2.0, 40.0, 5.0])
    got = batched_exponents(constant(-(a * b)[None, None], -(a + b)[None, None]), 16)
    assert got.sound.all()
    assert np.allclose(np.sort(got.logs.real, axis=0), np.sort([-a, -b], axis=0), rtol=1e-9, atol=0)
    assert np.all(np.abs(np.sort(got.logs.real, axis=0) - np.sort([-a, -b], axis=0)) <= got.errors.max(axis=0))


def mathieu(a, q):
    """y'' + pi^2 (a - 2 q cos 2 pi phase) y = 0: Mathieu's equation over its period pi."""

    def coefficients(phases):
        X = -(np.pi**2) * (a - 2 * q * np.cos(2 * np.pi * phases)[:, None])
        return X[:, None, None, :], np.zeros((len(phases), 1, 1, len(a)))

    return coefficients


def test_mathieus_known_exponent():
    """a = 1, q = 0.2: growth rate 0.099536437275513447 per unit of t, computed independently to 18 digits."""
    got = batched_exponents(mathieu(np.array([1.0]), np.array([0.2])), 48)
    growth = got.logs.real.max(axis=0) / np.pi
    assert abs(growth[0] - 0.099536437275513447) < 1e-11
    assert abs(growth[0] - 0.099536437275513447) <= got.errors.max() / np.pi


def test_segments_respect_the_breaks():
    """Meissner: x'' + (1 - 0.2 psi) x = 0, psi = +1 on the first third of the period pi, then -1: growth 0.04137974466122074514."""

    def coefficients(phases):
        X = -(np.pi**2) * (1 - 0.2 * np.where(phases % 1.0 < 1 / 3, 1.0, -1.0))
        return X[:, None, None, None], np.zeros((len(phases), 1, 1, 1))

    got = batched_exponents(coefficients, 8, breaks=(0.0, 1 / 3))
    assert abs(got.logs.real.max() / np.pi - 0.04137974466122074514) < 1e-11


def test_the_factors_are_of_order_four_and_symmetric_in_time():
    """Of two coordinates with damping that varies: the product of the factors, and of those of the reversed system, its inverse."""
    rng = np.random.default_rng(3)
    parts = rng.standard_normal((4, 2, 2, 1))

    def coefficients(phases):
        c, s = (f(2 * np.pi * phases)[:, None, None, None] for f in (np.cos, np.sin))
        return -9 * np.eye(2)[..., None] + 3 * (c * parts[0] + s * parts[1]), c * parts[2] + s * parts[3]

    def reversed_in_time(phases):
        X, Y = coefficients(1 - phases)
        return X, -Y

    def product(given, K):
        factors, _ = exponentiate_segments(given, np.linspace(0, 1, K + 1), np.ones(4), 1e-13)
        return np.linalg.eigvals(reduce(lambda P, F: F @ P, factors[..., 0]))

    exact = product(coefficients, 512)

    def miss(K):
        return np.abs(product(coefficients, K)[:, None] - exact).min(axis=1).max()

    assert 3.8 < np.log2(miss(24) / miss(48)) < 4.2
    there, back = product(coefficients, 24), product(reversed_in_time, 24)
    assert np.abs(there[:, None] * back - 1).min(axis=1).max() < 1e-11


def test_balancing_keeps_the_upper_half_a_multiple_of_the_identity():
    rng = np.random.default_rng(4)
    X, Y = -(10.0 ** rng.uniform(0, 8, (5, 3, 3, 2))), -(10.0 ** rng.uniform(0, 4, (5, 3, 3, 2)))
    scale = balance_states(X, Y)
    assert np.all(scale[3:] / scale[:3] == scale[3] / scale[0])
    assert np.all(np.log2(scale) % 1 == 0)


def test_ignorable_coordinates_are_left_out():
    """z' = R [y; y'; z] behind y'' = X y + Y y' + g z as rates of coordinates that nothing depends on, against the first-order system."""
    rng = np.random.default_rng(6)
    n, k, V = 2, 2, 3
    C, S = 3 * rng.standard_normal((2, n, 2 * n + k, V))
    K = rng.uniform(20, 200, (n, V))
    R = rng.standard_normal((k, 2 * n + k, V)) - 6 * np.eye(k, 2 * n + k, 2 * n)[..., None]

    def lower(phases):
        c, s = (f(2 * np.pi * phases)[:, None, None, None] for f in (np.cos, np.sin))
        rows = c * C + s * S - np.eye(n, 2 * n + k)[..., None] * K[:, None] - 2 * np.eye(n, 2 * n + k, n)[..., None]
        return np.concatenate([rows, np.broadcast_to(R, (len(phases), *R.shape))], axis=1)

    def coefficients(phases):
        rows = lower(phases)
        X = np.concatenate([rows[:, :, :n], np.zeros((len(phases), n + k, k, V))], axis=2)
        return X, rows[:, :, n:]

    got = batched_exponents(coefficients, 32, memory=k)
    assert got.sound.all()
    for v in range(V):

        def state_matrix(t, v=v):
            upper = np.broadcast_to(np.eye(n, 2 * n + k, n), (len(t), n, 2 * n + k))
            return np.concatenate([upper, lower(t)[..., v]], axis=1)

        exact = floquet(PeriodicSystem(state_matrix, 1.0), 1e-11)
        apart = got.logs[:, v, None] - exact.log_multipliers
        distance = np.hypot(apart.real, np.remainder(apart.imag + np.pi, 2 * np.pi) - np.pi)
        assert np.all(distance.min(axis=1) <= got.errors[:, v].max() + exact.error)
        assert np.all(distance.min(axis=0) <= got.errors[:, v].max() + exact.error)
        assert distance.min(axis=1).max() < 1e-7


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_errors_cover_random_damped_systems(seed):
    rng = np.random.default_rng(seed)
    n, V = 2, 5
    C, S = rng.standard_normal((2, n, n, V)) * 3
    K, D = rng.uniform(1, 400, (n, V)), rng.uniform(0.1, 30, (n, V))

    def coefficients(phases):
        X = (
            C * np.cos(2 * np.pi * phases)[:, None, None, None]
            + S * np.sin(2 * np.pi * phases)[:, None, None, None]
            - np.eye(n)[..., None] * K
        )
        return X, np.broadcast_to(-np.eye(n)[..., None] * D, X.shape)

    got = batched_exponents(coefficients, 32)
    for v in range(V):

        def state_matrix(t, v=v):
            A = np.zeros((len(t), 2 * n, 2 * n))
            X, Y = coefficients(t)
            A[:, :n, n:], A[:, n:, :n], A[:, n:, n:] = np.eye(n), X[..., v], Y[..., v]
            return A

        exact = floquet(PeriodicSystem(state_matrix, 1.0), 1e-11)
        apart = got.logs[:, v, None] - exact.log_multipliers
        distance = np.hypot(apart.real, np.remainder(apart.imag + np.pi, 2 * np.pi) - np.pi).min(axis=1)
        assert not got.sound[v] or np.all(distance <= got.errors[:, v].max() + exact.error)
