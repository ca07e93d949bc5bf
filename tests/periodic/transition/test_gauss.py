import numpy as np
import pytest
from scipy.linalg import expm

import flexlin as fl
from flexlin.periodic import factor_by, gauss_transitions
from flexlin.periodic.transition import gauss as collocation
from tests.periodic.systems import mathieu


@pytest.mark.parametrize(("method", "order"), [("gauss", k) for k in (2, 4, 6)] + [("radau", k) for k in (1, 3, 5)])
def test_order_of_convergence(method, order):
    A, count = mathieu(1.3, 0.7), np.array([16, 32, 64])

    def product(factors):
        return np.linalg.multi_dot(factors[::-1])

    exact, system = product(gauss_transitions(A, np.linspace(0, np.pi, 41), 10)), fl.PeriodicSystem(A, np.pi)
    found = [product(factor_by(system, np.linspace(0, np.pi, k + 1), method, order)) for k in count]
    slope = -np.polyfit(np.log(count), np.log(np.abs(found - exact).max(axis=(1, 2))), 1)[0]
    assert abs(slope - order) < 0.3


def test_constant_coefficients_give_the_exponential():
    A = np.array([[0, 1.0], [-4, -0.3]])
    Phi = gauss_transitions(lambda t: np.broadcast_to(A, (len(t), 2, 2)), np.array([0, 0.3, 1.0]), 9)
    np.testing.assert_allclose(Phi, [expm(0.3 * A), expm(0.7 * A)], rtol=1e-14, atol=1e-15)


def test_chunks_do_not_change_the_result(monkeypatch):
    grid = np.linspace(0, np.pi, 12)
    whole = gauss_transitions(mathieu(3.0, 2.0), grid, 3)
    monkeypatch.setattr(collocation, "CHUNK_BYTES", 2 * 6 * 6 * 8)
    np.testing.assert_array_equal(gauss_transitions(mathieu(3.0, 2.0), grid, 3), whole)
