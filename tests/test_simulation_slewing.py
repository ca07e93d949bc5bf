"""Drives whose torque changes at a limited rate: exact times of a double integrator, and the torque that they give."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.errors import SceneError, SimulationStopped
from flexlin.simulation import Events
from tests.closed_arm import closed
from tests.test_simulation_sticking import block, friction, spring

PD = spring(1.0, 0.2)


def limited(rate, torque=1e6):
    return {"control.saturation": {"torque": [torque], "rate": [rate]}}


@pytest.mark.slow
@pytest.mark.parametrize("sliding", [0.0, 0.05])
def test_a_torque_that_cannot_follow_is_a_ramp_until_it_has_caught_up(sliding):
    """J x'' = g - F, where g is the limit of ever faster lags g' = clip((asked - g) / lag, -rate, rate), by SciPy's Radau.

    With friction up to where the joint first turns round.
    """
    lin, limit = block(limited(0.5), PD, friction(sliding, 1.2 * sliding) if sliding else {}), 0.5
    inertia = lin.M(0.0)[0, 0]
    run = fl.simulate(lin, 0.6, initial=[0.0, 2.0], tol=1e-9)
    if sliding:
        before = np.searchsorted(run.t, run.events[0][0])
        run = replace(run, t=run.t[:before], nonlinear=run.nonlinear[:before], torque=run.torque[:before])
    assert run.torque[0, 0] == pytest.approx(-0.4)
    apart = []
    for lag in (2e-3, 1e-3, 5e-4):

        def rate(t, x, lag=lag):
            return [x[1], (x[2] - sliding) / inertia, np.clip((-x[0] - 0.2 * x[1] - x[2]) / lag, -limit, limit)]

        known = solve_ivp(rate, (0.0, run.t[-1]), [0.0, 2.0, -0.4], "Radau", run.t, rtol=1e-9, atol=1e-11).y.T
        apart.append(np.abs(known - np.hstack([run.nonlinear, run.torque])).max(axis=0))
    np.testing.assert_allclose(apart[0] / apart[1], 2.0, rtol=0.1)
    np.testing.assert_allclose(apart[1] / apart[2], 2.0, rtol=0.1)
    slopes = np.diff(run.torque[:, 0]) / np.diff(run.t)
    assert np.abs(slopes).max() <= limit * (1 + 1e-6)
    assert np.sum(np.abs(slopes) > limit * (1 - 1e-6)) > 10


def test_a_rate_that_is_never_reached_changes_nothing():
    runs = [fl.simulate(block(PD, more), 0.3, initial=[0.1, 0.0], tol=1e-9) for more in ({}, limited(1e9))]
    np.testing.assert_allclose(runs[0].nonlinear, runs[1].nonlinear, atol=1e-8)
    np.testing.assert_allclose(runs[0].torque, runs[1].torque, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gains", "size", "rate", "begin"), [((25.0, 4.0), 0.9, 3.0, 0.1), ((300.0, 3.0), 0.2, 5.0, 0.05)]
)
def test_rate_and_size_are_limited_together_on_an_elastic_arm(gains, size, rate, begin):
    """Under high gains what is asked falls, and soon rises again, when the ramp has caught up with it."""
    lin = closed(changes={"designs": []} | spring(*gains) | limited(rate, size))
    run = fl.simulate(lin, 0.25, initial=[begin, 0.0, 0.0, 0.0, 0.0, 0.0], tol=1e-6, points_per_period=512)
    assert np.abs(run.torque).max() <= size * (1 + 1e-9)
    assert np.abs(np.diff(run.torque[:, 0]) / np.diff(run.t)).max() <= rate * (1 + 1e-4)
    assert run.energy_error < 1e-4
    assert run.error < 1e-5


def test_a_rate_beside_sampling_is_refused_by_its_key():
    with pytest.raises(SceneError, match=r"control\.saturation\.rate"):
        block(limited(1.0), PD, {"control.sampling": {"period": 1e-3}})


def test_events_that_never_end_end_the_run(monkeypatch):
    monkeypatch.setattr(Events, "_guards", lambda self, t, asked, *signals: -np.ones((*asked.shape[:-1], 2)))
    with pytest.raises(SimulationStopped, match="input 1 goes on leaving and reaching its limit"):
        fl.simulate(block(limited(0.5), PD), 0.6, initial=[0.0, 2.0])
