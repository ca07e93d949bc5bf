"""Joints that stick and slide, and drives whose torque changes at a limited rate, by events: exact times of a sliding block, of a mass
pulled over a floor and of a double integrator, and arms of several joints."""

from collections import ChainMap
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.errors import ArgumentError, SceneError, SimulationStopped
from flexlin.simulation import Drive, Events
from tests.closed_arm import closed

BLOCK = {
    "links.0.modes": 0, "effects.gravity": "off", "effects.geometric_stiffening": "off", "effects.modal_damping": "off", "designs": [],
    "motion.joints": [{"amplitude": 0.0}], "control.feedforward": "none", "control.feedback": {"kind": "none"},
}  # fmt: skip


def block(*changes):
    """A rigid joint that nothing drives, with these changes."""
    return closed(changes=dict(ChainMap(*changes, BLOCK)))


def friction(sliding, static, **more):
    return {"effects.coulomb_friction": {"torque": sliding, "static": static, "rate": 0.01, **more}}


def spring(stiffness, damping=0.0, **moving):
    """A feedback as a spring, whose end is pulled at a rate."""
    pulled = {"motion": {"kind": "rotation", "joints": [moving]}} if moving else {}
    return {"control.feedback": {"kind": "pd", "kp": [stiffness], "kd": [damping]}, **pulled}


def test_a_sliding_block_stops_at_its_time_and_place_and_stays():
    lin = block(friction(0.05, 0.08))
    inertia = lin.M(0.0)[0, 0]
    run = fl.simulate(lin, 1.0, initial=[0.0, 1.0], tol=1e-10)
    assert [event[1:] for event in run.events] == [("q1", "sticks")]
    assert run.events[0][0] == pytest.approx(inertia / 0.05, rel=1e-10)
    rest = run.t > run.events[0][0]
    assert rest.sum() > 20
    np.testing.assert_allclose(run.nonlinear[rest], [[inertia / 0.1, 0.0]] * rest.sum(), rtol=1e-10, atol=1e-13)
    assert run.energy_error < 1e-9
    assert run.sticking == "q1 comes to rest 1 times and sticks for 23.1 % of the time"


PULLED = [(0.05, 0.08, 4.0, 0.3), (0.2, 0.25, 9.0, 1.1), (0.02, 0.3, 2.0, 0.7)]


@pytest.mark.slow
@pytest.mark.parametrize(("sliding", "static", "stiffness", "pull"), PULLED)
def test_a_mass_pulled_by_a_spring_sticks_and_slips_at_its_exact_times(sliding, static, stiffness, pull):
    """M x'' = k (V t - x) - F: with w^2 = k/M, a = (F_s - F_c)/k each slip lasts 2 (pi - atan(a w/V))/w, each rest 2 a/V."""
    lin = block(friction(sliding, static), spring(stiffness, rate=pull))
    w, a = np.sqrt(stiffness / lin.M(0.0)[0, 0]), (static - sliding) / stiffness
    slip, rest, first = 2 * (np.pi - np.arctan(a * w / pull)) / w, 2 * a / pull, static / stiffness / pull
    times, now = [], first
    while now < 0.25 * lin.period:
        times += [now, now + slip]
        now += slip + rest
    run = fl.simulate(lin, 0.25, initial=[0.0, -pull], tol=1e-10)
    found = [event for event in run.events if event[0] < times[-1] + 1e-6]
    np.testing.assert_allclose([event[0] for event in found], times[: len(found)], rtol=1e-7)
    assert len(found) >= min(len(times), 2)
    assert [event[2] for event in found[:2]] == ["slides", "sticks"]


def test_a_force_below_the_static_friction_moves_nothing_and_one_above_does():
    """A constant torque by the feedback's stiffness at an offset: 0.079 N m is held, 0.081 N m is not."""
    lin = block(friction(0.05, 0.08), spring(1.0, 0.2))
    held = fl.simulate(lin, 0.5, initial=[0.079, 0.0], tol=1e-9)
    np.testing.assert_array_equal(held.nonlinear, np.tile([0.079, 0.0], (len(held.t), 1)))
    loose = fl.simulate(lin, 0.5, initial=[0.081, 0.0], tol=1e-9)
    assert loose.events[0][1:] == ("q1", "sticks")
    assert abs(loose.nonlinear[-1, 0]) < 0.05


@pytest.mark.parametrize("ki", [0.0, 6.0])
def test_joints_stick_under_a_torque_that_is_sampled_and_held(ki):
    """J x'' = -(kp x + kd x' + ki z)_k - F over each sample, by its parabola, z_(k+1) = z_k + h x_k: loose joints stop in between."""
    kp, kd, step, sliding, static, start = 4.0, 0.1, 0.05, 0.05, 0.08, 0.5
    integral = {"control.feedback": {"kind": "pid", "kp": [kp], "kd": [kd], "ki": [ki]}} if ki else {}
    lin = block(integral, friction(sliding, static), spring(kp, kd))
    run = fl.simulate(lin, 1.0, initial=[start, 0.0], tol=1e-10, drive=Drive(sample_time=step))
    x, v, z, slip, found, inertia = start, 0.0, 0.0, 0.0, [], lin.M(0.0)[0, 0]
    for k in range(int(np.ceil(lin.period / step))):
        torque, left = -kp * x - kd * v - ki * z, step
        z += step * x
        if slip == 0 and abs(torque) > static:
            slip = np.sign(torque)
            found += [(k * step, "slides")] * (k > 0)
        while slip and left > 0:
            force = (torque - slip * sliding) / inertia
            stop = -v / force if v * force < 0 else np.inf
            move = min(stop, left)
            x, v, left = x + v * move + force * move**2 / 2, v + force * move, left - move
            if stop <= left + move:
                v, slip = 0.0, np.sign(torque) if abs(torque) > static else 0.0
                found.append(((k + 1) * step - left, "turns" if slip else "sticks"))
    known = [(t, what) for t, what in found if t < run.t[-1]]
    assert len(known) >= 3
    assert [what for *_, what in run.events] == [what for _, what in known]
    ends = [*(t for t, _ in known), run.t[-1]]
    rests = sum(ends[k + 1] - t for k, (t, what) in enumerate(known) if what == "sticks")
    assert f"sticks for {100 * rests / run.t[-1]:.3g} % of the time" in (run.sticking or "sticks for 0 % of the time")
    np.testing.assert_allclose([t for t, *_ in run.events], [t for t, _ in known], atol=1e-9)


@pytest.mark.slow
def test_an_elastic_arm_of_two_joints_sticks_while_its_links_ring():
    """A joint at rest keeps its angle exactly while the links ring, and the energy is what the work and the sliding leave."""
    changes = {"designs": [], "motion.joints": [{"amplitude": 0.0}] * 2} | friction([0.1, 0.05], [0.12, 0.05])
    changes["control.feedback"] = {"kind": "pd", "kp": [4.0, 2.0], "kd": [0.02, 0.01]}
    lin = closed("de-luca-siciliano-1991", changes)
    start = np.zeros(2 * lin.n)
    start[:2] = 0.05, -0.04
    run = fl.simulate(lin, 0.05, initial=start, tol=1e-7)
    assert run.energy_error < 1e-6
    (since, joint) = next((t, name) for t, name, what in run.events if what == "sticks")
    until = next((t for t, name, what in run.events if what == "slides" and name == joint and t > since), run.t[-1])
    rest, place = (run.t > since) & (run.t < until), lin.names.index(joint)
    assert np.ptp(run.nonlinear[rest, place]) < 1e-12 < 1e-6 < np.ptp(run.nonlinear[rest, 2])


def test_what_does_not_fit_is_refused_by_its_key():
    with pytest.raises(SceneError, match="static of at least torque"):
        block(friction(0.05, 0.04))
    with pytest.raises(SceneError, match=r"control\.saturation\.rate"):
        block(limited(1.0), PD, {"control.sampling": {"period": 1e-3}})
    with pytest.raises(SceneError, match="static beside stribeck"):
        block({"effects.coulomb_friction": {"torque": 0.05, "stribeck": 0.4}})
    pinned = closed(changes={"designs": [], "links.0.mode_shapes": "pinned-hub"} | friction(0.1, 0.2))
    with pytest.raises(ArgumentError, match="joints cannot stick here"):
        fl.simulate(pinned, 0.1)


STRIBECK = {"static": 0.08, "stribeck": 0.4}


def falling(rate, sliding=0.05, static=0.08, stribeck=0.4):
    """The Stribeck curve, and its slope, at a rate far beyond that of the sign's change."""
    more = (static - sliding) * np.exp(-((rate / stribeck) ** 2))
    return sliding + more, -2 * rate / stribeck**2 * more


def test_the_falling_branch_of_friction_is_a_negative_damping():
    """J y'' + (kd + F'(V)) y' + kp y = 0 about a rotation at a rate V: it grows where kd < -F'(V)."""
    for kd, verdict in ((0.05, "unstable"), (0.1, "stable")):
        lin = block(friction(0.05, **STRIBECK), spring(4.0, kd, rate=0.3))
        force, slope = falling(0.3)
        assert lin.D(0.0)[0, 0] == pytest.approx(kd + slope, rel=1e-12)
        assert lin.feedforward(np.zeros(1))[0] == pytest.approx(force, rel=1e-12)
        found = fl.floquet(lin.periodic_system())
        assert found.verdict == verdict
        np.testing.assert_allclose(found.exponents.real, -(kd + slope) / (2 * lin.M(0.0)[0, 0]), rtol=1e-6)


@pytest.mark.slow
def test_a_mass_slips_along_the_falling_branch_from_static_to_sliding_friction():
    """M x'' = k (V t - x) - F(x'): it breaks loose at F_s/(k V); when it rests again is SciPy's answer to the same equation."""
    stiffness, pull = 4.0, 0.3
    lin = block(friction(0.05, **STRIBECK), spring(stiffness, rate=pull))
    loose = 0.08 / stiffness / pull

    def slips(t, x):
        return [x[1], (stiffness * (pull * t - x[0]) - falling(x[1])[0]) / lin.M(0.0)[0, 0]]

    def rests(t, x):
        return x[1] + (t < loose + 0.05)

    rests.terminal, rests.direction = True, -1
    stopped = solve_ivp(slips, (loose, 5.0), [0.0, 1e-9], "DOP853", events=rests, rtol=1e-11, atol=1e-13).t_events[0][0]
    run = fl.simulate(lin, 1.2 * stopped / lin.period, initial=[0.0, -pull], tol=1e-10)
    assert [what for *_, what in run.events[:2]] == ["slides", "sticks"]
    np.testing.assert_allclose([t for t, *_ in run.events[:2]], [loose, stopped], rtol=1e-6)


@pytest.mark.slow
def test_a_linear_motion_that_outgrows_all_numbers_is_said_to():
    """A steep falling branch: what is left of the nonlinear motion is still an answer."""
    steep = {"effects.coulomb_friction": {"torque": 0.05, "static": 0.08, "stribeck": 1e-3, "rate": 1e-4}}
    lin = block(steep, spring(0.0, rate=7e-4), {"control.feedback": {"kind": "none"}, "control.feedforward": "rigid"})
    run = fl.simulate(lin, 8.0 / lin.period, initial=[0.0, 1e-5], tol=1e-6)
    assert np.isfinite(run.nonlinear).all()
    assert not np.isfinite(run.tip_linear).all()
    assert run.status.startswith("the linear motion grows beyond 100 rad or m")
    assert run.is_lost
    assert not replace(run, linear=np.full_like(run.linear, 99.0)).is_lost
    assert replace(run, linear=np.full_like(run.linear, 1e54)).is_lost


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
    ("gains", "size", "rate", "at"), [((25.0, 4.0), 0.9, 3.0, 0.1), ((300.0, 3.0), 0.2, 5.0, 0.05)]
)
def test_rate_and_size_are_limited_together_on_an_elastic_arm(gains, size, rate, at):
    """Under high gains what is asked falls, and soon rises again, when the ramp has caught up with it."""
    lin = closed(changes={"designs": []} | spring(*gains) | limited(rate, size))
    run = fl.simulate(lin, 0.25, initial=[at, 0.0, 0.0, 0.0, 0.0, 0.0], tol=1e-6, points_per_period=512)
    assert np.abs(run.torque).max() <= size * (1 + 1e-9)
    assert np.abs(np.diff(run.torque[:, 0]) / np.diff(run.t)).max() <= rate * (1 + 1e-4)
    assert run.energy_error < 1e-4
    assert run.error < 1e-5


def test_events_that_never_end_end_the_run(monkeypatch):
    monkeypatch.setattr(Events, "_guards", lambda self, t, asked, *signals: -np.ones((*asked.shape[:-1], 2)))
    with pytest.raises(SimulationStopped, match="input 1 goes on leaving and reaching its limit"):
        fl.simulate(block(limited(0.5), PD), 0.6, initial=[0.0, 2.0])
