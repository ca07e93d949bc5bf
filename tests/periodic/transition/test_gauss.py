import numpy as np
import pytest
from scipy.linalg import expm

from flexlin.periodic.transition import gauss as collocation
from flexlin.periodic.transition.gauss import gauss_transitions
from tests.periodic.systems import mathieu


def product(factors):
    total = np.eye(factors.shape[-1])
    for factor in factors:
        total = factor @ total
    return total


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_order_of_convergence_is_twice_the_stages(stages):
    A = mathieu(1.3, 0.7)
    exact = product(gauss_transitions(A, np.linspace(0, np.pi, 41), 10))
    count = np.array([8, 16, 32])
    error = [np.abs(product(gauss_transitions(A, np.linspace(0, np.pi, k + 1), stages)) - exact).max() for k in count]
    slope = -np.polyfit(np.log(count), np.log(error), 1)[0]
    assert abs(slope - 2 * stages) < 0.25


def test_constant_coefficients_give_the_exponential():
    A = np.array([[0, 1.0], [-4, -0.3]])
    Phi = gauss_transitions(lambda t: np.broadcast_to(A, (len(t), 2, 2)), np.array([0, 0.3, 1.0]), 9)
    np.testing.assert_allclose(Phi, [expm(0.3 * A), expm(0.7 * A)], rtol=1e-14, atol=1e-15)


def test_chunks_do_not_change_the_result(monkeypatch):
    grid = np.linspace(0, np.pi, 12)
    whole = gauss_transitions(mathieu(3.0, 2.0), grid, 3)
    monkeypatch.setattr(collocation, "CHUNK_BYTES", 2 * 6 * 6 * 8)
    np.testing.assert_array_equal(gauss_transitions(mathieu(3.0, 2.0), grid, 3), whole)
