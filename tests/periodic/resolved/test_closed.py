"""A loop closed by a series: made of what the plant has resolved already, against the loop sampled anew."""

import pickle

import numpy as np
import pytest

import flexlin as fl
from flexlin.periodic import FourierSeries, resolve

T = 1.3


def waving(rng, rows, columns, harmonics):
    """A random trigonometric polynomial."""
    return FourierSeries(rng.standard_normal((2 * harmonics + 1, rows, columns)), T)


@pytest.mark.parametrize("constant", ["none", "B", "K", "A"])
def test_the_product_of_series_is_the_loop_sampled_anew(constant):
    rng = np.random.default_rng(3)
    A, B, K = waving(rng, 3, 3, 4), waving(rng, 3, 2, 3), waving(rng, 2, 3, 6)
    A, B, K = (series.mean() if name == constant else series for name, series in zip("ABK", (A, B, K), strict=True))
    asked = []

    def counted(t):
        asked.append(len(t))
        return A(t)

    plant = fl.PeriodicSystem(A if constant == "A" else counted, T, B)
    _ = plant.resolved, plant.resolved_input
    before = sum(asked)
    loop = plant.feedback(K)
    found = loop.resolved
    assert sum(asked) - before < 10  # probes, where the gain is none that is known everywhere
    truth = resolve(loop.A, T)
    t = np.linspace(0, T, 77)
    assert np.all(np.abs(found(t) - loop.A(t)) <= found.error)
    assert found.degree >= truth.degree
    assert np.all(found.error <= 20 * truth.error + 1e-13)
    again = pickle.loads(pickle.dumps(fl.PeriodicSystem(A, T, B).feedback(K)))
    np.testing.assert_allclose(again.resolved(t), found(t), rtol=0, atol=1e-12)


def test_a_plant_that_jumps_is_sampled_with_its_loop():
    plant = fl.PeriodicSystem(lambda t: np.where(np.mod(t, T) < 0.4, -1.0, -2.0)[:, None, None], T, [[1.0]])
    loop = plant.feedback(waving(np.random.default_rng(1), 1, 1, 2))
    assert 0.4 in [place.time for place in loop.resolved.found]
    t = np.linspace(0, T, 77)
    assert np.all(np.abs(loop.resolved(t) - loop.A(t)) <= loop.resolved.error)
