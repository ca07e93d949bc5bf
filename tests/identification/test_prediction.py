"""Predictions of logs, against SciPy's integrator and by known shifts."""

import re
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.signal import lsim

import flexlin as fl
from flexlin.errors import ArgumentError
from flexlin.identification import Logged, Windows, prepare
from tests.identification.logs import coordinate, simulated, swing, tip

TIME = np.arange(400) * 0.005


def load(inputs=None, outputs=None, **more):
    """The scene with a log's table."""
    table = {"log": {"inputs": {"q1": {"column": "u"} | (inputs or {})}, "outputs": outputs}} if outputs else {}
    return fl.load_scene("single-link", {"links.0.modes": 1, "designs": []} | table | more)


SCENE = load()


@cache
def log_of(*seconds):
    """The log of the scene at these times, TIME where there are none, and the states."""
    time = np.array(seconds) if seconds else TIME
    outputs = {"q1": coordinate("q1"), "tip.y": tip(1)}
    readings, states = simulated(SCENE, time, lambda t: 0.3 * swing(t), outputs)
    return fl.Log(time, {"q1": 0.3 * swing(time)[0]}, readings), states


def test_a_column_in_another_unit_is_named_with_its_factor():
    log, _ = log_of()
    column = log.outputs["q1"]

    def predicted(rate):
        return fl.predict(SCENE, fl.Log(TIME, log.inputs, {**log.outputs, "q1_rate": rate}))

    for factor, said in ((1e3, "reads 1e.03 times"), (-1e3, "reads -1e.03 times")):
        assert re.search(f"q1_rate .*{said} what is predicted", predicted(factor * np.gradient(column, TIME)).status)
    still = predicted(0.3 + 0 * column)
    assert np.isnan(still.fit["q1_rate"])
    assert "q1_rate is constant" in still.status


@pytest.mark.slow
def test_gain_offset_delay_and_sensors_are_taken_into_account():
    """Reading = (value - offset) / gain, of the value `delay` ago; torque = gain reading + offset, `delay` later."""
    strain = {"sensor": "strain", "link": 0, "gain": -3.0, "offset": 0.02, "delay": 0.012}
    outputs = {"base": {"column": "volts", **strain}, "q1": {"column": "q"}}
    scene = load({"gain": 0.5, "offset": 0.1, "delay": 0.02}, outputs)
    curvature = fl.control.bending(scene, fl.linearize(fl.build_manipulator(scene), scene.motion), 0, 0.0)(np.zeros(1))
    fine = np.arange(2000) * 0.001

    def given(t):  # at rest before the log begins: what came before it is not known
        return swing(t) * np.clip((t - 0.2) / 0.2, 0, 1) ** 3

    sensors = {"q": coordinate("q1"), "w": coordinate("w11")}
    readings, _ = simulated(scene, fine, lambda t: 0.5 * given(t - 0.02) + 0.1, sensors)
    volts = (curvature[0, 0, 1] * readings["w"] - 0.02) / -3.0
    columns = {"t": TIME[40:], "u": given(TIME[40:])[0]}
    columns |= {"volts": np.interp(TIME[40:] - 0.012, fine, volts), "q": readings["q"][200::5]}
    found = fl.predict(scene, fl.read_log(columns, scene))
    assert set(found.fit) == {"volts", "q"}
    assert min(found.fit.values()) > 99.5


def test_columns_that_say_so_add_up_at_their_joint():
    """One reading loses a share of another: u = 0.7 u + 0.3 u. Two columns that name one joint by chance are refused."""
    log, outputs = log_of()[0], {"q1": {"column": "q"}}
    shared = {"log.inputs.q1.gain": 0.7, "log.inputs.crosstalk": {"column": "v", "gain": 0.3, "joint": "q1"}}
    columns = {"t": log.time, "u": log.inputs["q1"], "v": log.inputs["q1"], "q": log.outputs["q1"]}
    scenes = load(outputs=outputs), load(outputs=outputs, **shared)
    alike = [fl.predict(scene, fl.read_log(columns, scene)).outputs["q"] for scene in scenes]
    assert np.allclose(*alike, rtol=0, atol=1e-9)
    twice = fl.Log(log.time, {"q1": columns["u"], "arm": columns["u"]}, log.outputs)
    with pytest.raises(ArgumentError, match="of one joint"):
        fl.predict(load(**{"links.0.name": "arm"}), twice)


@pytest.mark.slow
def test_jittered_times_and_missing_readings_are_no_trouble():
    rng = np.random.default_rng(0)
    time = np.sort(TIME + rng.uniform(-0.002, 0.002, len(TIME)))
    time -= time[0]
    log, states = log_of(*time)
    q = log.outputs["q1"].copy()
    q[50:90] = np.nan
    found = fl.predict(SCENE, fl.Log(time, log.inputs, {**log.outputs, "q1": q}), window=1.0)
    assert min(found.fit.values()) > 99.9
    assert np.allclose(found.states[0], states[0], atol=1e-3)
    assert np.allclose(found.starts, [0.0, 1.0], atol=0.01)
    assert "40 readings of q1 are missing" in found.status
    assert "jitter" in found.status


@pytest.mark.slow
def test_no_window_goes_over_a_gap():
    found = fl.predict(SCENE, log_of()[0]._taken(np.r_[0:150, 230:400]), window=1.0)
    assert min(found.fit.values()) > 99.9
    assert "1 gap" in found.status
    assert not ((found.starts > 0.745) & (found.starts < 1.15)).any()
    assert len(found.time) == 320


def test_slopes_are_those_of_the_simulation():
    """By start, by numbers of the arm and of the log, against central differences of the whole prediction."""
    filtered = {"column": "b", "sensor": "tip-acceleration", "lowpass": {"frequency": 20.0, "damping": 0.7}}
    outputs = {"q1": {"column": "q", "delay": 0.013}, "tip_acceleration.y": {"column": "a", "gain": 2.0}}
    scene = load({"gain": 0.5, "delay": 0.011}, {**outputs, "filtered": filtered})
    free = ["effects.payload.mass", "log.inputs.q1.delay", "log.outputs.q1.delay", "log.inputs.q1.gain"]
    time = TIME[:120]
    log = fl.Log(time, {"q1": swing(time)[0]}, {"q1": time, "tip_acceleration.y": time, "filtered": time})
    model = Logged.of(scene, log, free)
    shooting = prepare(model, Windows.of(log, 0.3), model.arm.parameters.values)
    start, p = np.full((2, 6), 0.02), model.arm.parameters.values.copy()
    slopes = shooting.jacobian(shooting.run(start, p), p)

    def predicted(start, p):
        return shooting.predict(shooting.run(start, p), p)

    late = slice(10, None)  # a delayed sensor saw nothing of the window before that
    for k in range(10):
        by_start, by_p = 1e-6 * np.eye(10)[k, :6], 1e-6 * np.eye(10)[k, 6:]
        difference = (predicted(start + by_start, p + by_p) - predicted(start - by_start, p - by_p))[:, late] / 2e-6
        error = np.abs(difference - slopes[:, late, :, k]).max(axis=(0, 1))
        assert np.all(error < 2e-3 * np.abs(difference).max(axis=(0, 1)) + 1e-6)


def test_the_acceleration_of_the_tip_is_its_second_derivative():
    log, _ = log_of()
    acceleration = make_interp_spline(TIME, log.outputs["tip.y"], k=7)(TIME, 2)
    both = fl.Log(TIME, log.inputs, {"q1": log.outputs["q1"], "tip_acceleration.y": acceleration})
    assert fl.predict(SCENE, both).fit["tip_acceleration.y"] > 98


@pytest.mark.slow
def test_arms_with_loops_and_unknown_names_are_refused_in_words():
    with pytest.raises(ArgumentError, match="closed loops"):
        fl.predict(fl.load_scene("five-bar"), log_of()[0])
    for inputs, outputs, said in (
        ({"w11": TIME}, {"q1": TIME}, "no joint 'w11'"),
        ({"q1": TIME}, {"nobody": TIME}, "no joint 'nobody'"),
        ({"q1": TIME}, {"tip.z": TIME}, "no tip.z"),
    ):
        with pytest.raises(ArgumentError, match=said):
            fl.predict(SCENE, fl.Log(TIME, inputs, outputs))


def test_an_arm_that_spins_without_inertia_is_named():
    bare = {"links.0.axis": [1.0, 0.0, 0.0], "links.0.modes": 0, "effects": {"payload": {"mass": 0.03}}, "designs": []}
    log = fl.Log(TIME, {"q1": np.sin(TIME)}, {"q1": np.cos(TIME)})
    with pytest.raises(fl.errors.SingularMassMatrix, match="at rest"):
        fl.predict(fl.load_scene("single-link", bare), log)


@pytest.mark.slow
def test_a_filter_behind_a_sensor_is_followed():
    """Against SciPy's lsim of w^2 / (s^2 + 2 zeta w s + w^2) on the true angle."""
    w, zeta, (log, _) = 2 * np.pi * 3.0, 0.8, log_of()
    slow = {"column": "slow", "sensor": "encoder", "link": 0, "lowpass": {"frequency": 3.0, "damping": 0.8}}
    scene, q = load(outputs={"q1": {"column": "q"}, "slow": slow}), log.outputs["q1"]
    slow = lsim(([w**2], [1, 2 * zeta * w, w**2]), q, TIME)[1]
    found = fl.predict(scene, fl.Log(TIME, log.inputs, {"q1": q, "slow": slow}))
    assert min(found.fit.values()) > 99.5
    assert fl.predict(SCENE, fl.Log(TIME, log.inputs, {"q1": slow})).fit["q1"] < 95
