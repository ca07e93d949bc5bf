import numpy as np
import pytest
from scipy.linalg import expm

import flexlin as fl
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.transition.exponential import exponentiate
from flexlin.periodic.transition.gauss import gauss, gauss_transitions, place_nodes, sample_at
from flexlin.periodic.transition.magnus import average_sixth
from tests.periodic.systems import mathieu


@pytest.mark.parametrize("size", [0.0, 0.1, 3.0, 100.0])
def test_exponential_against_scipy(size):
    X = size * np.random.default_rng(2).standard_normal((7, 4, 4)) / 4
    np.testing.assert_allclose(exponentiate(X), [expm(x) for x in X], rtol=1e-10, atol=1e-12)


def test_order_of_convergence():
    A = mathieu(1.3, 0.7)
    grid = np.linspace(0, np.pi, 5)
    exact = gauss_transitions(A, grid, 12)
    count = np.array([4, 8, 16])
    error = []
    for k in count:
        edges = np.linspace(0, np.pi, 4 * k + 1)
        at_nodes = np.moveaxis(sample_at(A, place_nodes(edges, gauss(3).c)), 1, 0)
        fine = exponentiate(average_sixth(at_nodes, np.diff(edges)[:, None, None])).reshape(4, k, 2, 2)
        product = np.broadcast_to(np.eye(2), (4, 2, 2))
        for i in range(k):
            product = fine[:, i] @ product
        error.append(np.abs(product - exact).max())
    assert abs(-np.polyfit(np.log(count), np.log(error), 1)[0] - 6) < 0.3


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
