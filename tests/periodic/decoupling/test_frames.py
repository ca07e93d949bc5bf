"""The logarithm that closes a basis, where eigenvectors do not serve."""

import numpy as np
from scipy.linalg import expm

from flexlin.periodic.decoupling.frames import logarithm


def test_the_logarithm_of_defective_turns_closes_them():
    rng = np.random.default_rng(3)
    for _ in range(50):
        n = int(rng.integers(2, 7))
        blocks = np.diag(rng.choice([1.0, 1.0, 0.5, 0.3j], n)) + np.diag(rng.choice([0.0, 0.1, 1.0], n - 1), 1)
        basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
        H = basis @ blocks @ basis.T
        L = logarithm(H)
        np.testing.assert_allclose(expm(L), H, rtol=0, atol=1e-9 * np.linalg.norm(H))
        assert np.abs(np.linalg.eigvals(L).imag).max() <= np.pi + 1e-6


def test_no_logarithm_of_a_singular_turn():
    assert logarithm(np.diag([1.0, 0.0])) is None
