"""The companion form against its defining equation."""

import numpy as np
import pytest

from flexlin.errors import SingularMassMatrix
from flexlin.periodic import build_companion, build_input, stack_companion


def test_states_obey_the_equations_of_second_order():
    rng = np.random.default_rng(3)
    M, D, K = rng.standard_normal((3, 6, 4, 4))
    F, y, v, u = rng.standard_normal((6, 4, 2)), *rng.standard_normal((2, 6, 4, 1)), rng.standard_normal((6, 2, 1))
    t = np.arange(6.0)
    rate = build_companion(M, D, K, t) @ np.concatenate([y, v], axis=1) + build_input(M, F, t) @ u
    np.testing.assert_allclose(rate[:, :4], v)
    np.testing.assert_allclose(M @ rate[:, 4:] + D @ v + K @ y, F @ u, atol=1e-9)
    np.testing.assert_array_equal(stack_companion(K[0], D[0])[4:], np.hstack([K[0], D[0]]))


def test_a_singular_mass_names_its_time():
    M = np.stack([np.eye(2), np.zeros((2, 2))])
    with pytest.raises(SingularMassMatrix, match=r"t = 0\.75 s"):
        build_companion(M, M, M, np.array([0.5, 0.75]))
