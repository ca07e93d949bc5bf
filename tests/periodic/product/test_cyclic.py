"""The condensed cyclic system, with modes that grow and decay by 1e9 in each segment."""

import numpy as np
import pytest

from flexlin.periodic import cyclic_system


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def test_cyclic_system_solves_and_survives_growth_of_both_signs(rng):
    frames = np.linalg.qr(rng.standard_normal((38, 3, 3)))[0]
    frames[-1] = frames[0]
    F = frames[1:] @ np.diag([1e9, 0.5, 1e-9]) @ np.swapaxes(frames[:-1], 1, 2)
    x = rng.standard_normal((37, 3, 2))
    g = np.roll(x, -1, axis=0) - F @ x
    np.testing.assert_allclose(cyclic_system(F).solve(g), x, atol=1e-6)  # g is 1e9 large: ten digits are left at most


def test_null_vectors_close_the_period(rng):
    frames = np.linalg.qr(rng.standard_normal((12, 3, 3)))[0]
    frames[-1] = frames[0]
    F = frames[1:] @ np.diag([1e9, 1.0, 1e-9]) @ np.swapaxes(frames[:-1], 1, 2)
    x, sigma = cyclic_system(F).null_vectors(1)
    np.testing.assert_allclose(np.abs(np.einsum("kin,ki->kn", x, frames[:-1, :, 1])), 1, atol=1e-7)
    assert sigma[0] < 1e-7 < 0.1 < sigma[1]
