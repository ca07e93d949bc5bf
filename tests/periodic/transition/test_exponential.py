import numpy as np
import pytest
from scipy.linalg import expm

import flexlin as fl
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.transition.exponential import exponentiate


@pytest.mark.parametrize("size", [0.0, 0.1, 3.0, 100.0])
def test_exponential_against_scipy(size):
    X = size * np.random.default_rng(2).standard_normal((7, 4, 4)) / 4
    np.testing.assert_allclose(exponentiate(X), [expm(x) for x in X], rtol=1e-10, atol=1e-12)


def stiff(t):
    """Two weakly modulated oscillators, one of 3e4 rad/s, coupled and damped."""
    K = np.zeros((len(t), 2, 2))
    K[:, 0, 0] = 4 + 0.5 * np.cos(t)
    K[:, 1, 1] = 9e8 * (1 + 0 * t)
    K[:, 0, 1] = K[:, 1, 0] = np.sin(t)
    return K


def test_fast_modes_are_decoupled():
    system = fl.PeriodicSystem.from_second_order(np.eye(2), 0.02 * np.eye(2), stiff, 2 * np.pi)
    result = fl.floquet(system, tol=1e-8)
    assert result.setting.method == "decoupling"
    np.testing.assert_allclose(result.exponents.real, -0.01, atol=1e-9)
    assert result.verdict == "stable"
    slow = fl.PeriodicSystem.from_second_order(np.eye(1), 0.02 * np.eye(1), lambda t: stiff(t)[:, :1, :1], 2 * np.pi)
    reference = fl.floquet(slow, tol=1e-12).exponents
    assert np.abs(result.exponents[:, None] - reference).min(axis=0).max() < 1e-8


def test_overflow_is_an_error_not_a_number():
    with pytest.raises(ToleranceNotReached, match="more segments"):
        exponentiate(np.array([[[1000.0]]]))
