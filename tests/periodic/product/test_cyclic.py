"""The condensed cyclic system, with modes that grow and decay by 1e9 in each segment."""

import numpy as np

from flexlin.periodic import cyclic_system


def test_cyclic_system_survives_growth_of_both_signs_and_has_null_vectors_that_close_the_period():
    rng = np.random.default_rng(7)
    frames = np.linalg.qr(rng.standard_normal((12, 3, 3)))[0]
    frames[-1] = frames[0]
    unlike, closed = (frames[1:] @ np.diag([1e9, m, 1e-9]) @ np.swapaxes(frames[:-1], 1, 2) for m in (0.5, 1.0))
    x = rng.standard_normal((11, 3, 2))
    g = np.roll(x, -1, axis=0) - unlike @ x
    np.testing.assert_allclose(
        cyclic_system(unlike).solve(g), x, atol=1e-6
    )  # g is 1e9 large: ten digits are left at most
    x, sigma = cyclic_system(closed).null_vectors(1)
    np.testing.assert_allclose(np.abs(np.einsum("kin,ki->kn", x, frames[:-1, :, 1])), 1, atol=1e-7)
    assert sigma[0] < 1e-7 < 0.1 < sigma[1]
