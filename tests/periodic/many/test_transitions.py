"""Batched transition matrices against those of one system at a time, and their order."""

import numpy as np

from flexlin.periodic.many.transitions import batched_transitions
from flexlin.periodic.product.balancing import multiply_scaled
from flexlin.periodic.transition.gauss import gauss_transitions

a, q = np.array([1.0, 2.5, 7.0]), np.array([0.2, 1.0, 0.1])


def coefficients(phases):
    X = -(np.pi**2) * (a - 2 * q * np.cos(2 * np.pi * phases)[:, None])
    return X[:, None, None, :], np.full((len(phases), 1, 1, 3), -0.3)


def alone(v):
    def A(t):
        X, Y = coefficients(t)
        zero, one = np.zeros_like(t), np.ones_like(t)
        return np.stack([zero, one, X[:, 0, 0, v], Y[:, 0, 0, v]], axis=1).reshape(-1, 2, 2)

    return multiply_scaled(gauss_transitions(A, np.linspace(0, 1, 41), 8))


def test_agrees_with_one_system_at_a_time():
    got = batched_transitions(coefficients, 16, 7)
    for v in range(3):
        P, log_scale = alone(v)
        assert np.abs(got[v] - P * np.exp(log_scale)).max() < 1e-12


def test_order_of_convergence():
    exact = batched_transitions(coefficients, 32, 8)
    errors = [np.abs(batched_transitions(coefficients, k, 2) - exact).max() for k in (16, 32)]
    assert 3.8 < np.log2(errors[0] / errors[1]) < 4.2
