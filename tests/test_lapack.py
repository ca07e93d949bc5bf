"""LAPACK without SciPy's checks: the same answers, and refusal of what has none."""

import numpy as np
import pytest
import scipy.linalg

from flexlin import lapack


def test_schur_forms_are_those_of_scipy():
    rng = np.random.default_rng(3)
    for n in (1, 2, 6, 70):
        A = rng.standard_normal((n, n))
        for given in (A, A + 1j * rng.standard_normal((n, n))):
            T, Z = lapack.complex_schur(given)
            assert np.abs(Z @ T @ Z.conj().T - given).max() < 1e-13 * n
            assert not np.tril(T, -1).any()
            assert np.array_equal(T, scipy.linalg.schur(given, output="complex")[0])


def test_what_has_no_answer_is_refused():
    with pytest.raises(ValueError, match="infs or NaNs"):
        lapack.complex_schur(np.full((2, 2), np.nan))
