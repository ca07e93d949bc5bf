"""Predictions of logs, against SciPy's integrator and by known shifts."""

import re
from functools import lru_cache

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ArgumentError
from flexlin.identification import Logged, Windows, prepare
from tests.identification.logs import coordinate, simulated, swing, tip

TIME = np.arange(400) * 0.005
SCENE = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})


@lru_cache
def usual_log():
    return log_of(TIME)


def log_of(time):
    outputs = {"q1": coordinate("q1"), "tip.y": tip(1)}
    readings, states = simulated(SCENE, time, lambda t: 0.3 * swing(t), outputs)
    return fl.Log(time, {"q1": 0.3 * swing(time)[0]}, readings), states


@pytest.mark.slow
def test_a_log_of_the_scene_itself_is_predicted():
    log, states = usual_log()
    found = fl.predict(SCENE, log, window=1.0)
    assert min(found.fit.values()) > 99.9
    assert np.allclose(found.states[0], states[0], atol=1e-3)
    assert np.allclose(found.starts, [0.0, 1.0])


def test_another_payload_is_seen():
    log, _ = usual_log()
    other = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "effects.payload.mass": 0.5})
    assert fl.predict(other, log).fit["q1"] < 90


def test_a_column_in_another_unit_is_named_with_its_factor():
    log, _ = usual_log()
    column = log.outputs["q1"]
    for factor, said in ((1e3, "reads 1e.03 times"), (-1e3, "reads -1e.03 times")):
        wrong = fl.Log(
            log.time, log.inputs, {**log.outputs, "q1": column, "q1_rate": factor * np.gradient(column, log.time)}
        )
        assert re.search(f"q1_rate .*{said} what is predicted", fl.predict(SCENE, wrong).status)
    still = fl.Log(log.time, log.inputs, {**log.outputs, "q1_rate": 0.3 + 0 * column})
    found = fl.predict(SCENE, still)
    assert np.isnan(found.fit["q1_rate"])
    assert "q1_rate is constant" in found.status


@pytest.mark.slow
def test_gain_offset_delay_and_sensors_are_taken_into_account():
    """Reading = (value - offset) / gain, of the value `delay` ago; torque = gain reading + offset, `delay` later."""
    strain = {"sensor": "strain", "link": 0, "gain": -3.0, "offset": 0.02, "delay": 0.012}
    table = {
        "inputs": {"q1": {"column": "u", "gain": 0.5, "offset": 0.1, "delay": 0.02}},
        "outputs": {"base": {"column": "volts", **strain}, "q1": {"column": "q"}},
    }
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "log": table})
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


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [{"gain": -1.0}, {"gain": 0.8}, {"delay": 0.06}])
def test_a_wrong_sign_gain_or_delay_of_the_torque_is_seen(wrong):
    table = {"inputs": {"q1": {"column": "u"} | wrong}, "outputs": {"q1": {"column": "q"}}}
    log, _ = usual_log()
    assert fl.predict(fl.load_scene("single-link", {"links.0.modes": 1, "log": table}), log).fit["q1"] < 97


def test_columns_that_say_so_add_up_at_their_joint():
    """One reading loses a share of another: u = 0.7 u + 0.3 u. Two columns that name one joint by chance are refused."""
    log, _ = usual_log()
    known = {"log": {"inputs": {"q1": {"column": "u"}}, "outputs": {"q1": {"column": "q"}}}}
    first, second = {"column": "u", "gain": 0.7}, {"column": "v", "gain": 0.3, "joint": "q1"}
    shared = {"log": {"inputs": {"q1": first, "crosstalk": second}, "outputs": known["log"]["outputs"]}}
    columns = {"t": log.time, "u": log.inputs["q1"], "v": log.inputs["q1"], "q": log.outputs["q1"]}
    one, both = (fl.load_scene("single-link", {"links.0.modes": 1, "designs": []} | table) for table in (known, shared))
    alike = [fl.predict(scene, fl.read_log(columns, scene)).outputs["q"] for scene in (one, both)]
    assert np.allclose(*alike, rtol=0, atol=1e-9)
    named = fl.load_scene("single-link", {"links.0.modes": 1, "links.0.name": "arm", "designs": []})
    twice = fl.Log(log.time, {"q1": columns["u"], "arm": columns["u"]}, log.outputs)
    with pytest.raises(ArgumentError, match="of one joint"):
        fl.predict(named, twice)


@pytest.mark.slow
def test_jittered_times_and_missing_readings_are_no_trouble():
    rng = np.random.default_rng(0)
    time = np.sort(TIME + rng.uniform(-0.002, 0.002, len(TIME)))
    time -= time[0]
    log, _ = log_of(time)
    q = log.outputs["q1"].copy()
    q[50:90] = np.nan
    found = fl.predict(SCENE, fl.Log(time, log.inputs, {**log.outputs, "q1": q}))
    assert min(found.fit.values()) > 99.9
    assert "40 readings of q1 are missing" in found.status
    assert "jitter" in found.status


@pytest.mark.slow
def test_no_window_goes_over_a_gap():
    log, _ = usual_log()
    with_gap = log._taken(np.r_[0:150, 230:400])
    found = fl.predict(SCENE, with_gap, window=1.0)
    assert min(found.fit.values()) > 99.9
    assert "1 gap" in found.status
    inside = [((found.starts > 0.745) & (found.starts < 1.15)).any()]
    assert inside == [False]
    assert len(found.time) == 320


def test_slopes_are_those_of_the_simulation():
    """By start, by numbers of the arm and of the log, against central differences of the whole prediction."""
    table = {
        "inputs": {"q1": {"column": "u", "gain": 0.5, "delay": 0.011}},
        "outputs": {
            "q1": {"column": "q", "delay": 0.013},
            "tip_acceleration.y": {"column": "a", "gain": 2.0},
            "filtered": {"column": "b", "sensor": "tip-acceleration", "lowpass": {"frequency": 20.0, "damping": 0.7}},
        },
    }
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "log": table})
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
    log, _ = usual_log()
    from scipy.interpolate import make_interp_spline

    acceleration = make_interp_spline(TIME, log.outputs["tip.y"], k=7)(TIME, 2)
    both = fl.Log(TIME, log.inputs, {"q1": log.outputs["q1"], "tip_acceleration.y": acceleration})
    assert fl.predict(SCENE, both).fit["tip_acceleration.y"] > 98


@pytest.mark.slow
def test_arms_with_loops_and_unknown_names_are_refused_in_words():
    log, _ = usual_log()
    with pytest.raises(fl.errors.ArgumentError, match="closed loops"):
        fl.predict(fl.load_scene("five-bar"), log)
    for inputs, outputs, said in (
        ({"w11": TIME}, {"q1": TIME}, "no joint 'w11'"),
        ({"q1": TIME}, {"nobody": TIME}, "no joint 'nobody'"),
        ({"q1": TIME}, {"tip.z": TIME}, "no tip.z"),
    ):
        with pytest.raises(fl.errors.ArgumentError, match=said):
            fl.predict(SCENE, fl.Log(TIME, inputs, outputs))


def test_an_arm_that_spins_without_inertia_is_named():
    bare = {"links.0.axis": [1.0, 0.0, 0.0], "links.0.modes": 0, "effects": {"payload": {"mass": 0.03}}, "designs": []}
    log = fl.Log(TIME, {"q1": np.sin(TIME)}, {"q1": np.cos(TIME)})
    with pytest.raises(fl.errors.SingularMassMatrix, match="at rest"):
        fl.predict(fl.load_scene("single-link", bare), log)


@pytest.mark.slow
def test_a_filter_behind_a_sensor_is_followed():
    """Against SciPy's lsim of w^2 / (s^2 + 2 zeta w s + w^2) on the true angle."""
    from scipy.signal import lsim

    w, zeta = 2 * np.pi * 3.0, 0.8
    table = {
        "inputs": {"q1": {"column": "u"}},
        "outputs": {
            "q1": {"column": "q"},
            "slow": {"column": "slow", "sensor": "encoder", "link": 0, "lowpass": {"frequency": 3.0, "damping": 0.8}},
        },
    }
    log, _ = usual_log()
    q = log.outputs["q1"]
    slow = lsim(([w**2], [1, 2 * zeta * w, w**2]), q, TIME)[1]
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": [], "log": table})
    found = fl.predict(scene, fl.Log(TIME, log.inputs, {"q1": q, "slow": slow}))
    assert min(found.fit.values()) > 99.5
    assert fl.predict(SCENE, fl.Log(TIME, log.inputs, {"q1": slow})).fit["q1"] < 95
