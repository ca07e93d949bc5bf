"""Entries of M, D, K that ought to be zero do not decide how the others are represented."""

import numpy as np

import flexlin as fl
from flexlin.periodic import FourierSeries, weigh_entries
from tests.periodic.judge import covers


def system(noise):
    """Two coordinates, the coupling of which is the rounding of two large terms that cancel, or that times zero."""

    def part(k):
        def of(t):
            c, s, one = np.cos(np.pi * t), np.sin(np.pi * t), np.ones_like(t)
            cancelled = noise * ((1e4 * c + s) - 1e4 * c - s)
            M = [[2.0 + 0.3 * c, 0.1 * s], [0.1 * s, one]]
            D = [[0.4 * one, cancelled], [cancelled, 3.0 + 0.1 * c]]
            K = [[30.0 + 2 * s, cancelled], [cancelled, 9e3 + 20 * c]]
            return np.array([M, D, K][k]).transpose(2, 0, 1)

        return of

    return fl.PeriodicSystem.from_second_order(part(0), part(1), part(2), 2.0)


def test_noise_where_terms_cancel_leaves_a_smooth_system_smooth():
    assert isinstance(system(1.0).resolved.series, FourierSeries)
    found, truth = fl.floquet(system(1.0), tol=1e-10), fl.floquet(system(0.0), tol=1e-10)
    assert covers(found, truth.exponents, 2.0, truth.errors)


def test_a_small_entry_across_a_large_one_keeps_its_digits():
    """Exponents of y'' + K y = 0 depend on K_12 K_21; where K_12 = 1e8 the digits of K_21 = 1e-8 count."""
    M, D, K = np.eye(2)[None], np.zeros((1, 2, 2)), np.array([[[4.0, 1e8], [1e-8, 9.0]]])
    least = weigh_entries(np.concatenate([M, D, K], axis=2))
    assert least[1, 4] < 1e-6

    def stiffness(t):
        s = np.sin(np.pi * t)
        return np.array([[4.0 + 0 * s, 1e8 * (1 + 0.5 * s)], [1e-8 * (1 + 0.3 * s), 9.0 + 0 * s]]).transpose(2, 0, 1)

    scaled = np.diag([1e4, 1e-4])
    rough = fl.PeriodicSystem.from_second_order(np.eye(2), 0.1 * np.eye(2), stiffness, 2.0)
    even = fl.PeriodicSystem.from_second_order(
        np.eye(2), 0.1 * np.eye(2), lambda t: np.linalg.inv(scaled) @ stiffness(t) @ scaled, 2.0
    )
    one, other = fl.floquet(rough, tol=1e-10), fl.floquet(even, tol=1e-10)
    pairs = (np.sort(result.exponents.imag) + 1j * np.sort(result.exponents.real) for result in (one, other))
    np.testing.assert_allclose(*pairs, rtol=0, atol=1e-8)
