"""A smooth function resolved in one call of compiled code, against the same by NumPy; what it leaves to be asked and refused."""

import numpy as np
import pytest

from flexlin.errors import NotPeriodic
from flexlin.periodic.resolved.fitting import fit_at_once
from flexlin.periodic.resolved.foresight import foresee
from flexlin.periodic.resolved.resolve import foresee_times, resolve
from flexlin.periodic.resolved.weights import weigh_entries

PERIOD, PLACES = 0.7, np.linspace(0.01, 0.69, 16)


def wavy(seed, n=3, decay=0.35, turns=1.0):
    """[M D K] of n coordinates with entries of all sizes, some of them zero."""
    rng = np.random.default_rng(seed)
    waves = rng.normal(size=(2, 20, n, 3 * n)) * decay ** np.arange(20)[:, None, None]
    size = 10.0 ** rng.uniform(-6, 6, (n, 3 * n)) * (rng.random((n, 3 * n)) < 0.8)
    mean = np.hstack([np.eye(n), np.zeros((n, n)), 9 * np.eye(n)])

    def values(t):
        angle = 2 * np.pi * turns / PERIOD * np.outer(t, np.arange(20))
        moving = np.tensordot(np.cos(angle), waves[0], 1) + np.tensordot(np.sin(angle), waves[1], 1)
        return size * (mean + 0.3 * moving)

    return values


def fitted(values, weighed):
    return fit_at_once(foresee(values, 27, [*foresee_times(PERIOD), PLACES]), PERIOD, weighed=weighed)


@pytest.mark.parametrize("weighed", [False, True])
def test_compiled_code_and_numpy_resolve_alike(weighed):
    for seed in range(4):
        values = wavy(seed)
        one = fitted(values, weighed)
        least = weigh_entries(values(PLACES)) if weighed else 0.0
        other = resolve(values, PERIOD, complete=True, least=least)
        assert (one.degree, one.samples) == (other.degree, other.samples)
        size = np.abs(other.series.coefficients).max(axis=0)
        assert (np.abs(one.series.coefficients - other.series.coefficients) <= 1e-14 * size).all()
        assert (one.error <= 3 * other.error).all()  # mostly rounding
        assert (other.error <= 3 * one.error).all()


def test_what_does_not_fit_is_left_to_be_asked():
    assert fitted(wavy(1, decay=0.9, turns=2.0), True) is None  # more harmonics
    assert fitted(lambda t: np.where(t < 0.3, np.nan, wavy(1)(t)), True) is None
    assert fitted(lambda t: np.abs(np.sin(np.pi * t / PERIOD))[:, None, None] * np.ones((3, 9)), False) is None


def test_a_wrong_period_is_left_to_be_refused():
    wrong = wavy(2, turns=0.5)
    assert fitted(lambda t: wrong(np.where(t < PERIOD, t, t + PERIOD / 3)), True) is None

    def beyond(t):
        return wavy(2)(t) * (1 + 1e-6 * (t >= PERIOD) * np.sin(t))[:, None, None]

    assert fitted(beyond, False) is None
    with pytest.raises(NotPeriodic):
        resolve(beyond, PERIOD, complete=True)
