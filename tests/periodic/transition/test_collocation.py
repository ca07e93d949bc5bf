"""Collocation by Gauss and Radau: known nodes, orders of convergence, exponentials, breaks, units."""

import numpy as np
import pytest
from scipy.linalg import block_diag, expm

import flexlin as fl
from flexlin.periodic import factor_by, gauss_transitions, place_edges
from flexlin.periodic.transition import gauss as collocation
from tests.periodic.judge import covers
from tests.periodic.systems import lyapunov_transformed, mathieu, meissner


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


def test_the_last_stage_stays_before_a_break():
    grid = place_edges(np.pi, (np.pi / 3,), 8)
    found = factor_by(fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)), grid, "radau", 11)
    np.testing.assert_allclose(found, gauss_transitions(meissner, grid, 6), atol=1e-11)


@pytest.mark.parametrize(("method", "order"), [("auto", None), ("gauss", 8), ("radau", 9)])
@pytest.mark.parametrize("seed", range(3))
def test_units_of_the_states_move_no_exponent(method, order, seed):
    """The exponents know nothing of units, however far apart these are.

    Elimination without like units lost all digits here: errors of 1e5, or "needs 25,000 segments".
    """
    rng, constant = np.random.default_rng(seed), block_diag([[-0.3, 2.7], [-2.7, -0.3]], 0.2)
    plain = lyapunov_transformed(constant, 2.0, 2, rng)
    units = 2.0 ** rng.integers(-40, 40, 3)
    system = fl.PeriodicSystem(lambda t: plain(t) * (units / units[:, None]), np.pi)
    found = fl.floquet(system, 1e-8, method=method, order=order)
    known = np.array([0.2, -0.3 + 0.7j, -0.3 - 0.7j])  # folded by i omega = 2 i
    assert found.verdict == "unstable"
    assert covers(found, known, np.pi)
    assert found.error < 1e-6
