"""States in units that are far apart: the exponents know nothing of units."""

import numpy as np
import pytest

import flexlin as fl
from tests.periodic.judge import covers
from tests.periodic.systems import lyapunov_transformed

CONSTANT = np.array([[-0.3, 2.7, 0.0], [-2.7, -0.3, 0.0], [0.0, 0.0, 0.2]])


@pytest.mark.parametrize(("method", "order"), [("auto", None), ("gauss", 8), ("radau", 9)])
@pytest.mark.parametrize("seed", range(3))
def test_units_of_the_states_move_no_exponent(method, order, seed):
    """Elimination without like units lost all digits here: errors of 1e5, or "needs 25,000 segments"."""
    rng = np.random.default_rng(seed)
    plain = lyapunov_transformed(CONSTANT, 2.0, 2, rng)
    units = 2.0 ** rng.integers(-40, 40, 3)
    system = fl.PeriodicSystem(lambda t: plain(t) * (units / units[:, None]), np.pi)
    found = fl.floquet(system, 1e-8, method=method, order=order)
    known = np.array([0.2, -0.3 + 0.7j, -0.3 - 0.7j])  # folded by i omega = 2 i
    assert found.verdict == "unstable"
    assert covers(found, known, np.pi)
    assert found.error < 1e-6
