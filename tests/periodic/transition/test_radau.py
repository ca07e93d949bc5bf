import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic import factor_by, gauss_transitions, place_edges, radau
from tests.periodic.systems import colaneri, mathieu, meissner


def test_three_stages_are_hairer_s():
    """Solving ODEs II, table IV.5.6."""
    r = np.sqrt(6)
    np.testing.assert_allclose(radau(3).c, [(4 - r) / 10, (4 + r) / 10, 1], atol=1e-15)
    np.testing.assert_allclose(radau(3).b, [(16 - r) / 36, (16 + r) / 36, 1 / 9], atol=1e-15)


@pytest.mark.parametrize("stages", [1, 2, 3])
def test_order_of_convergence(stages):
    A = mathieu(1.3, 0.7)
    system = fl.PeriodicSystem(A, np.pi)
    exact = np.linalg.multi_dot(gauss_transitions(A, np.linspace(0, np.pi, 21), 10)[::-1])
    count = np.array([16, 32, 64])
    error = [
        np.abs(
            np.linalg.multi_dot(factor_by(system, np.linspace(0, np.pi, k + 1), "radau", 2 * stages - 1)[::-1]) - exact
        ).max()
        for k in count
    ]
    assert abs(-np.polyfit(np.log(count), np.log(error), 1)[0] - (2 * stages - 1)) < 0.3


def test_the_last_stage_stays_before_a_break():
    grid = place_edges(np.pi, (np.pi / 3,), 8)
    found = factor_by(fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)), grid, "radau", 11)
    np.testing.assert_allclose(found, gauss_transitions(meissner, grid, 6), atol=1e-11)


def test_radau_as_the_method_of_floquet():
    result = fl.floquet(fl.PeriodicSystem(colaneri, 2 * np.pi), method="radau", tol=1e-8)
    assert np.all(np.abs(result.exponents - [0, -24]) <= result.errors)
    assert result.error < 24e-8
    fine = fl.floquet(fl.PeriodicSystem(colaneri, 2 * np.pi), method="radau", order=9, segments=256)
    np.testing.assert_allclose(fine.exponents, [0, -24], atol=1e-7)
    assert np.all(np.abs(fine.exponents - [0, -24]) <= fine.errors)
