"""What changes fast in the input matrix alone is seen by all that integrates under an input: closed forms of one state."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

import flexlin as fl
from flexlin.control import sampled_floquet

T, DECAY, PLACE = 2.0, 0.7, 0.8123


def pulsed(width: float) -> fl.PeriodicSystem:
    """x' = -0.7 x + b(t) u, b = 1 and a Gaussian pulse of unit height over its width."""

    def b(t):
        return 1 + np.exp(-(((np.mod(t, T) - PLACE) / width) ** 2)) / width

    return fl.PeriodicSystem([[-DECAY]], T, lambda t: b(t)[:, None, None])


@pytest.mark.parametrize("width", [1e-2, 1e-3, 2e-4])
def test_the_h2_norm_holds_a_pulse_of_the_input(width: float) -> None:
    """H2^2 = mean of b^2 / (2 a), the pulse's square from -inf to inf. Of a ten-thousandth of the period nothing was seen: 0.56 for 31."""
    square = 1 + (2 * np.sqrt(np.pi) + np.sqrt(np.pi / 2) / width) / T
    found = fl.h2_norm(pulsed(width), [[1.0]])
    assert abs(found.value - np.sqrt(square / (2 * DECAY))) <= found.error + 1e-14 * found.value
    assert found.error < 1e-9 * found.value


@pytest.mark.parametrize("width", [1e-2, 1e-3, 2e-4])
def test_a_held_input_acts_by_its_pulse(width: float) -> None:
    """x_(k+1) = (exp(-a h) - G_k K) x_k, G_k the integral of exp(-a (h - s)) b(t_k + s): by QUADPACK with the pulse's place."""
    count, gain = 10, 0.3
    h, factor = T / count, 1.0
    b = pulsed(width).B
    for k in range(count):
        at = sorted({k * h, (k + 1) * h, *(p for p in PLACE + width * np.arange(-9, 10) if k * h < p < (k + 1) * h)})
        G = sum(
            quad(lambda s: np.exp(-DECAY * ((k + 1) * h - s)) * b(np.array([s])).item(), u, v, epsabs=1e-15)[0]  # noqa: B023
            for u, v in pairwise(at)
        )
        factor *= np.exp(-DECAY * h) - G * gain
    found = sampled_floquet(pulsed(width), np.array([[gain]]), h)
    assert abs(found.exponents[0].real - np.log(abs(factor)) / T) <= found.errors[0] + 1e-13
    assert found.errors[0] < 1e-9
