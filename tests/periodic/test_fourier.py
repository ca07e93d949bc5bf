"""Trigonometric interpolation of random polynomials, whose values and derivatives are summed up by hand."""

import numpy as np
import pytest

from flexlin.periodic import FourierSeries

T = 1.7


def polynomial(rng, harmonics, shape):
    """A function (t, derivative) -> (N, *shape) with the harmonics 0 ... H."""
    a, b = rng.standard_normal((2, harmonics + 1, *shape))

    def function(t, derivative=0):
        total = 0.0
        for k in range(harmonics + 1):
            w = 2 * np.pi * k / T
            angle = w * np.asarray(t) + derivative * np.pi / 2
            wave = np.multiply.outer(np.cos(angle), a[k]) + np.multiply.outer(np.sin(angle), b[k])
            total = total + w**derivative * wave
        return total

    return function


@pytest.mark.parametrize("shape", [(), (3,), (2, 4), (0,)])
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_a_trigonometric_polynomial_is_reproduced(shape, derivative):
    rng = np.random.default_rng(5)
    function = polynomial(rng, 6, shape)
    series = FourierSeries.through(function(T * np.arange(13) / 13), T)
    t = rng.uniform(-5, 5, 50)
    np.testing.assert_allclose(series(t, derivative), function(t, derivative), atol=1e-9, rtol=1e-9)
    assert series(0.3).shape == shape
    np.testing.assert_allclose(series(0.3, derivative), series(np.array([0.3]), derivative)[0])
