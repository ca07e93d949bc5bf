"""Eigenvalues of long products for many values at once: a value that cannot be computed leaves its neighbours alone."""

import warnings

import numpy as np
import pytest

from flexlin.periodic.many.spectrum import find_product_logs


def random_factors(segments, n, values, seed):
    g = np.random.default_rng(seed)
    return np.eye(n)[None, :, :, None] + 0.3 * g.standard_normal((segments, n, n, values)) / np.sqrt(n)


@pytest.mark.parametrize("huge", [1e160, 1e200, np.inf])
def test_an_overflowing_value_is_unsound_and_its_neighbours_are_as_if_alone(huge):
    factors = random_factors(8, 3, 3, 5)
    factors[::2, 0, 1, 1] = huge
    factors[1::2, 1, 0, 1] = huge
    log_det = np.log(np.abs(np.linalg.det(np.moveaxis(factors[..., [0, 2]], -1, 1)))).sum(axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        logs, sound, _ = find_product_logs(factors, np.array([log_det[0], 0.0, log_det[1]]), 1e-10)
    assert list(sound) == [True, False, True]
    for value in (0, 2):
        product = np.linalg.multi_dot(factors[::-1, :, :, value])
        expected = np.sort_complex(np.linalg.eigvals(product))
        assert np.abs(np.sort_complex(np.exp(logs[:, value])) - expected).max() < 1e-9 * np.abs(expected).max()
