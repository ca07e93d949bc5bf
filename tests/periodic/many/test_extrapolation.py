"""Richardson's extrapolation of logs from three resolutions, on expansions that are known."""

import numpy as np
import pytest

from flexlin.periodic.many.extrapolation import MULTIPLES, extrapolate, find_gains

EXACT = np.array([[0.3 + 3.1j, -2.0], [-0.7 - 3.1j, -40.0 + 1j]])


def expand(powers, segments):
    """Logs with errors h^k of all the powers given, wrapped as logs of multipliers are."""
    logs = EXACT + 0.4 * (1 + 0.3j) * sum((1 / segments) ** k for k in powers)
    return logs.real + 1j * (np.remainder(logs.imag + np.pi, 2 * np.pi) - np.pi)


@pytest.mark.parametrize("k", range(2, len(MULTIPLES)))
def test_powers_four_and_six_vanish_and_the_error_covers_what_is_left(k):
    three = MULTIPLES[k - 2 : k + 1]
    logs, _ = extrapolate([expand((4, 6), n) for n in three], find_gains(*three), 0.0)
    assert np.allclose(logs, EXACT, rtol=0, atol=1e-13)
    logs, errors = extrapolate([expand((4, 6, 8), n) for n in three], find_gains(*three), 0.0)
    apart = np.abs(logs - EXACT)
    assert np.all(apart > 1e-8)
    assert np.all(apart <= errors)


def test_a_change_that_vanishes_by_chance_leaves_the_step_and_the_change_of_the_others():
    """The two results of order 6 made equal for one exponent: its error does not vanish with their difference."""
    three = MULTIPLES[:3]
    gains = find_gains(*three)
    coarse, middle, fine = (expand((4, 8), n) for n in three)
    a = middle - coarse
    shift = ((1 + gains[0]) * (fine - middle) - gains[1] * a) / (1 + gains[0] + gains[1])
    middle = middle + np.array([[1.0], [0.0]]) * shift
    step = np.abs(gains[0] * (fine - middle))
    change = np.abs((1 + gains[0]) * (fine - middle) - gains[1] * (middle - coarse))
    _, errors = extrapolate([coarse, middle, fine], gains, 0.0)
    assert np.allclose(change[0], 0.0, atol=1e-15)
    assert np.allclose(errors[0], 1.75 * 0.03 * change[1] + 0.05 * step[0], rtol=1e-6)
    assert np.all(errors[1] > errors[0])
