"""What changes fast in the input matrix alone is seen by all that integrates under an input: closed forms of one state."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.control import sampled_floquet
from tests.periodic.dense import at, transition

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
    """x_(k+1) = (exp(-a h) - G_k K) x_k, both from [x; u] integrated with the pulse's place."""
    count, gain, factor, b = 10, 0.3, 1.0, pulsed(width).B
    h, about = T / count, PLACE + width * np.arange(-9, 10)
    for k in range(count):
        stops = np.unique(np.clip([k * h, *about, (k + 1) * h], k * h, (k + 1) * h))
        step = transition(lambda t: np.array([[-DECAY, at(b, t).item()], [0.0, 0.0]]), np.eye(2), stops)
        factor *= step[0, 0] - step[0, 1] * gain
    found = sampled_floquet(pulsed(width), np.array([[gain]]), h)
    assert abs(found.exponents[0].real - np.log(abs(factor)) / T) <= found.errors[0] + 1e-13
    assert found.errors[0] < 1e-9


PLANT = fl.PeriodicSystem([[-DECAY]], T, [[1.0]], complete=True)
"""It promises that nothing of its own is narrow, and says nothing of what others put beside it."""
PLACES = (0.7171 * T, 0.5555 * T)


def pulse(t: np.ndarray, place: float) -> np.ndarray:
    """A Gaussian pulse of a width of T / 5000 and the area sqrt(pi)."""
    width = 2e-4 * T
    return np.exp(-(((np.mod(t, T) - place) / width) ** 2)) / width


@pytest.mark.parametrize("place", PLACES)
def test_a_complete_plant_hides_no_pulse_of_the_gain_or_force(place: float) -> None:
    loop = PLANT.feedback(lambda t: 0.3 * (1 + pulse(t, place))[:, None, None])
    found = fl.floquet(loop)
    assert found.exponents[0].real == pytest.approx(-DECAY - 0.3 * (1 + np.sqrt(np.pi) / T), abs=1e-9)
    response = fl.forced_response(PLANT, lambda t: pulse(t, place)[:, None])
    decayed = np.exp(-DECAY * (T - place)) * np.sqrt(np.pi)  # from the pulse's place to the end of the period
    assert response(0.0).item() == pytest.approx(decayed / (1 - np.exp(-DECAY * T)), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES)
def test_a_complete_plant_hides_no_pulse_of_the_weight_or_output(place: float) -> None:
    """2 a X - X' = Q (R so large that no control is worth it), H2^2 = mean of c^2 / (2 a)."""
    made = fl.periodic_lqr(PLANT, lambda t: pulse(t, place)[:, None, None], [[1e9]])
    before = np.exp(-2 * DECAY * place) * np.sqrt(np.pi) / (1 - np.exp(-2 * DECAY * T))
    assert made.X(np.zeros(1)).item() == pytest.approx(before, rel=1e-6)
    norm = fl.h2_norm(PLANT, lambda t: pulse(t, place)[:, None, None])
    assert norm.value == pytest.approx(np.sqrt(np.sqrt(np.pi / 2) / (2e-4 * T) / T / (2 * DECAY)), rel=1e-6)
    assert fl.hinf_norm(PLANT, lambda t: pulse(t, place)[:, None, None]).value > norm.value
    estimator = fl.control.kalman_filter(PLANT, [[1e-5]], lambda t: pulse(t, place)[:, None, None], [[1.0]])
    after = np.exp(-2 * DECAY * (T - place)) * np.sqrt(np.pi) / (1 - np.exp(-2 * DECAY * T))
    assert estimator.P(np.zeros(1)).item() == pytest.approx(after, rel=1e-6)
