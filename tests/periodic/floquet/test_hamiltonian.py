import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic.floquet.exponents import is_hamiltonian
from tests.periodic.systems import colaneri, mathieu, mathieu_second_order
from tests.periodic.truths import apart


def M(t):
    return np.diag([2.0, 1.0]) + 0.3 * np.sin(t)[:, None, None] * np.ones((2, 2))


def K(t):
    return np.diag([3.0, 7.0]) + 0.4 * np.cos(2 * t)[:, None, None] * np.array([[1.0, 2.0], [2.0, 0.0]])


SPIN = np.array([[0, 0.6], [-0.6, 0]])


def second_order(damping, M=M, K=K):
    return fl.PeriodicSystem.from_second_order(M, damping, K, 2 * np.pi)


def spinning(t):
    return 0.3 * np.cos(t)[:, None, None] * np.ones((2, 2)) + SPIN


def half_spin(t):
    return 5 * np.eye(2) + np.cos(t)[:, None, None] * SPIN / 2


VARYING_SPIN = second_order(lambda t: np.sin(t)[:, None, None] * SPIN, np.eye(2), half_spin)


@pytest.mark.parametrize(
    "system",
    [fl.PeriodicSystem(mathieu(2.2, 0.5), np.pi), mathieu_second_order(2.2, 0.5), second_order(spinning)],
)
def test_exponents_of_undamped_systems_are_paired_exactly(system):
    assert is_hamiltonian(system)
    result = fl.floquet(system)
    assert apart(result.exponents, -result.exponents, result.period).min(axis=1).max() < 1e-15
    assert result.verdict == "undecided"
    assert "bounded" in result.status


def test_only_what_is_damped_or_driven_is_not_taken_for_undamped():
    weak = second_order(lambda t: spinning(t) + 1e-4 * np.eye(2))
    others = second_order(np.zeros((2, 2))), fl.PeriodicSystem(colaneri, 2 * np.pi), fl.PeriodicSystem(-np.eye(3), 1.0)
    assert not any(map(is_hamiltonian, (weak, *others)))
    assert is_hamiltonian(VARYING_SPIN)
    assert fl.floquet(weak).verdict == "stable"
