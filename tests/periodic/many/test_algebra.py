"""Matrices with the values on the last axis, against SciPy one by one."""

import numpy as np
import pytest
import scipy.linalg

from flexlin.periodic.many.algebra import exponentiate_batch, factor_qr, multiply, solve_positive


@pytest.fixture
def matrices():
    return np.random.default_rng(3).standard_normal((4, 4, 7))


def each(A):
    return np.moveaxis(A, -1, 0)


def test_exponential_meets_its_accuracy(matrices):
    for accuracy in (1e-6, 1e-12):
        E = exponentiate_batch(3 * matrices, accuracy)
        for X, got in zip(each(3 * matrices), each(E), strict=True):
            exact = scipy.linalg.expm(X)
            assert np.linalg.norm(got - exact) <= 20 * np.linalg.norm(X) * accuracy * np.linalg.norm(exact)


def test_qr_of_well_and_badly_scaled_columns(matrices):
    A = matrices * np.array([1.0, 1e-5, 1e-9, 1e-13])[None, :, None]
    Q, R = factor_qr(A)
    assert np.abs(multiply(np.swapaxes(Q, 0, 1), Q) - np.eye(4)[..., None]).max() < 1e-14
    assert np.abs(multiply(Q, R) - A).max() < 1e-14
    assert np.all(R[np.tril_indices(4, -1)] == 0)


def test_solve_with_a_positive_definite_matrix(matrices):
    M = multiply(matrices, np.swapaxes(matrices, 0, 1))
    Z = solve_positive(M, matrices)
    assert np.allclose(multiply(M, Z), matrices, rtol=0, atol=1e-10)


def test_a_matrix_that_is_not_positive_definite_gives_nan_for_its_value_only(matrices):
    M = multiply(matrices, np.swapaxes(matrices, 0, 1))
    M[..., 2] *= -1
    bad = np.isnan(solve_positive(M, matrices)).any(axis=(0, 1))
    assert bad.tolist() == [False, False, True, False, False, False, False]
