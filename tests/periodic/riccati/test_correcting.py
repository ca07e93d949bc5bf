"""Periodic Riccati equations with fast modes and with weights that lie far apart: their errors are met."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic import periodic_riccati
from flexlin.periodic.riccati.nodes import FourierNodes
from studies import scaling


@pytest.mark.slow
def test_cheap_control_of_a_turning_field_is_no_longer_limited_by_rounding() -> None:
    """A satellite's torques act across the field alone: where control is cheap, segments lost seven digits of the gain."""
    w = 1e-3
    A = np.zeros((6, 6))
    A[:3, 3:], A[3:, :3], A[3, 5], A[5, 3] = np.eye(3), -(w**2) * np.diag([2.0, 1.5, 0.5]), w, -w

    def B(t: np.ndarray) -> np.ndarray:
        values = np.zeros((len(t), 6, 3))
        b = np.stack([np.cos(w * t), np.full(len(t), -0.6), 2 * np.sin(w * t)], axis=1) * 1e-7
        for i, j, sign in ((0, 1, 1), (1, 2, 1), (2, 0, 1), (1, 0, -1), (2, 1, -1), (0, 2, -1)):
            values[:, 3 + i, j] = sign * b[:, 3 - i - j]
        return values

    system = fl.PeriodicSystem(A, 2 * np.pi / w, B, complete=True)
    solution = periodic_riccati(system, np.diag([1.0, 1, 1, 1e6, 1e6, 1e6]), 1e-7 * np.eye(3), tol=1e-10)
    assert solution.error <= 1e-10
    assert solution.gain_error <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("Q", "R"), [(1.0, 100.0), (10.0, 0.01)])
def test_a_chain_of_flexible_links_is_solved_by_corrections_whatever_its_weights(Q: float, R: float) -> None:
    """Three links with two modes each: finer nodes are tried where few prove nothing, and where Newton's method settles on many alone."""
    scene = scaling.scene_of(3, 2)
    plant = fl.linearize(fl.build_manipulator(scene), scene.motion)
    loose, tight = (fl.periodic_lqr(plant, Q=Q * np.eye(18), R=R * np.eye(3), tol=tol).solution for tol in (1e-6, 1e-8))
    t = np.linspace(0.0, plant.period, 101)
    K = tight.K(t)
    assert loose.gain_error < 1e-6
    assert np.abs(loose.K(t) - K).max() <= (loose.gain_error + tight.gain_error) * np.abs(K).max()


def test_small_entries_of_the_cost_keep_their_waves() -> None:
    """A fast mode's rate costs 1e-9 of its angle: waves that were cut below the largest entry's rounding took digits of the gain."""
    nodes = FourierNodes(64, 2.0)
    X = np.tile(np.diag([1.0, 1e-9]), (64, 1, 1))
    X[:, 1, 1] *= 1 + 1e-7 * np.cos(5 * np.pi * nodes.t)
    assert np.abs(nodes.series(X)(nodes.t)[:, [0, 1], [0, 1]] / X[:, [0, 1], [0, 1]] - 1).max() < 1e-14
