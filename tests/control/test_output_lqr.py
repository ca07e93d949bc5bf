"""Static output feedback: against a search by SciPy on constant Lyapunov equations, and the same in turning coordinates."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

import flexlin as fl
from flexlin.errors import ArgumentError, NotStabilizable
from tests.periodic.systems import turn, turned
from tests.thinned import thin

A0 = np.array([[0.0, 1.0, 0.0], [-1.0, -0.1, 0.5], [0.2, 0.0, -0.3]])
B0, C0 = np.array([[0.0], [1.0], [0.2]]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.3]])
Q, R = np.diag([3.0, 1.0, 2.0]), np.array([[0.2]])


def best_gain():
    def cost(k):
        K = k.reshape(1, 2)
        loop = A0 - B0 @ K @ C0
        if np.linalg.eigvals(loop).real.max() >= 0:
            return 1e9
        return np.trace(solve_continuous_lyapunov(loop.T, -(Q + C0.T @ K.T @ R @ K @ C0)))

    found = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 2000})
    return found.x, found.fun


@pytest.mark.parametrize("turning", thin([False, True]))
def test_a_plant_gets_the_gain_that_a_search_finds_in_turning_coordinates_too(turning):
    (system, C), P = turned(A0, B0, C0), turn(3, 2.0)
    if turning:
        made = fl.output_lqr(system, C, lambda t: P(t) @ Q @ np.swapaxes(P(t), 1, 2), R)
        assert fl.floquet(made.closed_loop).verdict == "stable"
    else:
        made = fl.output_lqr(fl.PeriodicSystem(A0, 1.0, B=B0), C0, Q, R)
    K, cost = best_gain()
    np.testing.assert_allclose(made.K[0], K, rtol=1e-4)
    assert made.cost == pytest.approx(cost, rel=1e-8)
    assert made.status.startswith("converged")


@pytest.mark.slow
def test_an_unstable_plant_begins_at_a_state_feedback_or_is_refused():
    system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    made = fl.output_lqr(system, np.eye(2), np.eye(2), np.eye(1))
    np.testing.assert_allclose(made.K, [[1.0, np.sqrt(3.0)]], rtol=1e-5)
    with pytest.raises(NotStabilizable, match="rates beside angles"):
        fl.output_lqr(system, [[1.0, 0.0]], np.eye(2), np.eye(1))
    with pytest.raises(ArgumentError, match="C does not fit"):
        fl.output_lqr(system, [[1.0]], np.eye(2), np.eye(1))


def test_a_sensor_that_tells_nothing_new_changes_nothing():
    """Dead, or twice the same: the gains of both together are those of the one."""
    system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0, B=[[0.0], [1.0]])
    alone, dead, twice = (
        fl.output_lqr(system, [[0.0, 1.0], *other], np.eye(2), np.eye(1)).K[0]
        for other in ([], [[0.0, 0.0]], [[0.0, 1.0]])
    )
    np.testing.assert_allclose(dead, [alone[0], 0.0], atol=1e-9)
    np.testing.assert_allclose(twice, [alone[0] / 2] * 2, rtol=1e-6)
