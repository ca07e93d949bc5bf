"""What the drives have to do: against the simulation, a motor's own equations, and limits that do not fit."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import analyse
from flexlin.control import drive_load
from flexlin.errors import ArgumentError
from flexlin.report import advise, record, to_json
from tests.closed_arm import both, closed

SMALL = {"links.0.modes": 1}


@pytest.mark.slow
def test_the_work_of_the_drives_is_what_the_simulation_says():
    """Torque as simulated; the power integrated over a period is the work done on the arm, by its energy and damping."""
    lin = closed("de-luca-siciliano-1991")
    run = fl.simulate(lin, 1, tol=1e-8, points_per_period=1024)
    load = drive_load(lin, run.t, run.nonlinear, lin.law)
    np.testing.assert_allclose(load.torque, run.torque, atol=1e-12)
    mean = lambda values: values[:-1].mean(axis=0) + 0 * values[0]  # noqa: E731
    y, v = run.nonlinear[:, : lin.n], run.nonlinear[:, lin.n :]
    energy = lin.about.of_arm("energy", run.t, y, v)[:, 0, 0]
    rates = lin.about.positions(run.t, y, v)[1]
    lost = np.einsum("ti,ti->t", rates, lin.about.of_arm("damping", run.t, y, v)[:, :, 0])
    left = energy[-1] - energy[0] + lin.period * mean(lost[:, None])[0]
    assert lin.period * mean(load.power).sum() == pytest.approx(left, abs=2e-3 * np.abs(load.power).max())
    found = {(demand.what, demand.joint): demand.value for demand in load.demands}
    assert found["peak torque", "q2"] == np.abs(run.torque[:, 1]).max()
    assert found["peak power", "q1"] == np.abs(load.power[:, 0]).max()


def test_a_motors_current_is_that_of_its_winding():
    """u = R i + k N q', torque = N k i; the same torque by a constant of the drives' table."""
    motor = {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": 30.0}
    gains = {"control.feedback.kp": [12.0], "control.feedback.kd": [1.0]}
    lin = closed("single-link", {**SMALL, "effects.motor": motor, **gains})
    t = np.linspace(0, lin.period, 64, endpoint=False)
    x = 0.1 * np.random.default_rng(3).normal(size=(64, 4))
    load = drive_load(lin, t, x, lin.law)
    u, speed = lin.law.torque(t, x)[:, 0], load.speed[:, 0]
    assert load.current is not None
    np.testing.assert_allclose(u, 2.0 * load.current[:, 0] + 0.05 * 30 * speed, rtol=1e-12)
    np.testing.assert_allclose(load.torque, 1.5 * load.current, rtol=1e-12)
    assert lin.input_units == ("V",)
    scene, _, plain = both("single-link", {**SMALL, "drives": {"torque_constant": "1.5 N m/A"}})
    other = drive_load(plain, t, x, plain.law, scene.drives)
    np.testing.assert_allclose(other.torque, 1.5 * other.current, rtol=1e-12)


@pytest.mark.slow
def test_the_report_marks_loops_above_their_drives_and_sampled_ones():
    drives = {"torque": {"peak": "1.1 N m", "continuous": "5 N m"}, "speed": "300 deg/s"}
    weights, sampling = {"joints": "0.5 deg", "rates": "5 deg/s", "input": "0.5 N m"}, {"period": 0.004, "delay": 0.001}
    table = [{"name": "LQR", "kind": "periodic-lqr", "weights": weights}]
    overrides = {**SMALL, "drives": drives, "designs": table, "control.sampling": sampling, "accuracy.tol": 1e-6}
    found = analyse(fl.load_scene("single-link", overrides))
    load = found.load(found.own)
    assert [demand.what for demand in load.exceeded] == ["peak torque"]
    assert load.exceeded[0].limit == 1.1
    assert found.load(found.open_loop) is None, "it keeps no steady motion"
    data = record(found)
    assert data["floquet"]["drives"]["exceeds"] is True
    assert data["designs"]["LQR"]["drives"]["demands"][0]["what"] == "peak torque"
    assert to_json(data)
    said = " ".join(advise(found))
    assert "asks more than the drives give: peak torque of q1" in said
    assert [loop.name for loop in found.sampled] == ["scene's PD, sampled", "LQR, sampled"]
    assert [loop.verdict for loop in found.sampled] == ["stable", "unstable"]
    assert "Sampled every 4 ms and 1 ms late, the LQR is unstable" in said


@pytest.mark.parametrize(
    ("drives", "words"),
    [
        ({"torque": {"peak": ["1 N m", "2 N m"]}}, "2 quantities"),
        ({"speed": "1 m/s"}, "another unit"),
        ({"torque": {"peak": "3 N"}}, "unit"),
    ],
)
def test_limits_that_do_not_fit_are_refused_before_any_work(drives, words):
    with pytest.raises(ArgumentError, match=words):
        analyse(fl.load_scene("single-link", {"drives": drives}))
