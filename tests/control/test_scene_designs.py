"""Designs that a scene describes, in all that is made of them: with integrals of the joints' errors, a sample time, an estimator."""

import numpy as np
import pytest
import scipy.io
import xarray
from scipy.integrate import cumulative_simpson
from scipy.linalg import solve_continuous_are

import flexlin as fl
from flexlin.analyses import Clock, Loop, analyse, plant_and_designs
from flexlin.control import design, gain_source, kalman_filter, output_feedback, save, scene_sensors
from flexlin.control.export.files import Labels
from flexlin.errors import ArgumentError, NumericalError, SceneError
from flexlin.report import export_all, record
from flexlin.scene import EstimatorTable
from tests.closed_arm import both
from tests.control.test_c_controllers import call, library, needs_compiler

WEIGHTS = {"joints": "0.5 deg", "rates": "5 deg/s", "deflection": "8 mm", "input": "0.25 N m"}
INTEGRAL = {"name": "LQI", "kind": "periodic-lqr", "weights": WEIGHTS | {"integrals": "0.2 deg s"}}
NUMBERS = {"state_weight": [9.0, 9.0, 0.1, 0.1], "input_weight": [2.0]}
SAMPLED = {"name": "digital", "kind": "periodic-lqr", **NUMBERS, "sample_time": 0.05}
SENSORS = {"encoders": "0.02 deg", "strain": [{"link": 1, "noise": "0.01 1/m"}], "torque": "10 mN m"}
ESTIMATED = {"name": "LQG", "kind": "periodic-lqr", "weights": WEIGHTS, "estimator": SENSORS | {"sample_time": "2 ms"}}


def arm_of(table, **changes):
    """The scene, its arm alone and with the scene's own law."""
    return both("single-link", {"designs": [table], "links.0.modes": 1, **changes})


@pytest.fixture(scope="module")
def integral():
    scene, plant, closed = arm_of(INTEGRAL)
    return scene, plant, closed, design(plant, scene.designs[0])


@pytest.fixture(scope="module")
def sampled():
    scene, plant, _ = arm_of(SAMPLED)
    return scene, plant, design(plant, scene.designs[0])


@pytest.mark.parametrize("kind", ["periodic-lqr", "frozen-lqr", "averaged-lqr"])
def test_the_gain_of_an_arm_at_rest_is_that_of_the_widened_riccati_equation(kind):
    scene, plant, _ = arm_of(INTEGRAL | {"kind": kind}, **{"motion.joints": [{"amplitude": 0.0}]})
    found, deg = design(plant, scene.designs[0]), np.pi / 180
    A = np.block([[plant.A(np.zeros(1))[0], np.zeros((4, 1))], [np.eye(5)[:1]]])
    B = np.append(plant.input_matrix(np.zeros(1))[0], [[0.0]], axis=0)
    Q = np.diag(1 / np.array([0.5 * deg, 8e-3, 5 * deg, np.inf, 0.2 * deg]) ** 2)
    X = solve_continuous_are(A, B, Q, [[0.25**-2]])
    np.testing.assert_allclose(found.K(np.zeros(1))[0], 0.25**2 * B.T @ X, rtol=1e-7)
    assert (found.controller.names, found.controller.units) == (("q1_integral",), ("rad s",))


def test_a_constant_torque_leaves_no_mean_error_of_an_integral(integral):
    _, plant, closed, found = integral
    assert fl.floquet(found.closed_loop).verdict == "stable"
    shifted = fl.forced_response(found.closed_loop, lambda t: 0.3 * found.closed_loop.B(t)[:, :, 0])
    assert abs(shifted(plant.period * np.arange(64) / 64)[:, 0].mean()) < 1e-9
    law = closed.law.with_gain(found.K, found.controller)
    run = fl.simulate(closed, 0.5, initial=[1e-3, 0.0, 0.0, 0.0], law=law, tol=1e-8, points_per_period=1024)
    assert run.controller_names == ("q1_integral",)
    summed = cumulative_simpson(run.nonlinear[:, 0], x=run.t, initial=0)
    np.testing.assert_allclose(run.controller[:, 0], summed, atol=1e-7)


def test_an_estimated_loop_keeps_its_separation(integral):
    scene, plant, _, found = integral
    estimator = scene_sensors(scene, plant, EstimatorTable.model_validate(SENSORS)).filter(plant)
    loop = fl.floquet(output_feedback(found, estimator))
    parts = [fl.floquet(one).exponents for one in (found.closed_loop, estimator.closed_loop)]
    apart = np.abs(loop.exponents[:, None] - np.concatenate(parts)[None]).min(axis=1)
    assert np.all(apart < np.maximum(1e-6, 10 * loop.errors))


def test_files_hold_gain_and_rates_of_integrals_in_one_order(integral, tmp_path):
    scene, plant, _, found = integral
    export_all(plant, (Loop("LQI", "periodic-lqr", None, design=found),), tmp_path, 16, scene)
    mat = scipy.io.loadmat(tmp_path / "system.mat", simplify_cells=True)["designs"]
    np.testing.assert_array_equal(np.atleast_2d(mat["rates"]), found.controller.rates)
    wanted = found.K(plant.period * np.array([3 / 16]))[0, 0]
    np.testing.assert_allclose(np.atleast_1d(mat["K"][..., 3]).ravel(), wanted, rtol=1e-15)
    with xarray.open_dataset(tmp_path / "system.nc", engine="scipy") as data:
        assert (data["K_0"].shape, data["rates_0"].shape) == ((16, 1, 5), (1, 5))
    assert Labels.fitting(plant, 5, 1, found.controller).states[-1] == "q1_integral"


def test_a_sampled_design_of_a_scene_is_that_of_its_plant(sampled):
    _, plant, made = sampled
    same = fl.sampled_lqr(plant.periodic_system(), np.diag(SAMPLED["state_weight"]), 2.0, 0.05)
    np.testing.assert_array_equal(made.K(same.instants), same.K)
    np.testing.assert_array_equal(made.floquet().exponents, same.floquet().exponents)
    assert made.kind == "sampled-lqr"
    assert made.error < 1e-9


@pytest.mark.slow
def test_a_report_judges_the_held_torque(sampled):
    scene, _, made = sampled
    a = analyse(scene)
    block = record(a)["designs"]["digital"]
    assert (block["kind"], block["verdict"]) == ("sampled-lqr", "stable")
    np.testing.assert_allclose(block["exponents"][0].real, made.floquet(1e-8).exponents[0].real, atol=1e-7)
    assert [loop.name for loop in a.loops].count("digital") == 1


@needs_compiler
def test_compiled_gains_are_those_of_the_nearest_sample_and_matlab_gets_all(sampled, tmp_path):
    _, plant, made = sampled
    files, count = gain_source(made, plant.period, tmp_path, lin=plant), round(plant.period / 0.05)
    compiled = library(files).gain_matrix
    for phase in [*np.arange(count) / count, 0.3 / count, 0.7 / count, 1 - 0.3 / count]:
        wanted = made.K(np.array([phase * plant.period]))[0, 0]
        np.testing.assert_allclose(call(compiled, phase, size=4), wanted, rtol=1e-15)
    assert "nearest of 40 samples" in next(one for one in files if one.suffix == ".h").read_text()
    for name in ("plant.mat", "plant.nc"):
        save(plant.periodic_system(), tmp_path / name, (made,), phases=7, lin=plant)
    held = scipy.io.loadmat(tmp_path / "plant.mat")["designs"]["samples"][0, 0]
    np.testing.assert_array_equal(np.moveaxis(held, -1, 0), made.K(0.05 * np.arange(40)))


def test_what_is_not_known_of_held_torques_is_refused(sampled):
    scene, plant, _ = sampled
    with pytest.raises(ArgumentError, match="sample_time ="):
        design(plant, arm_of(SAMPLED | {"sample_time": 1 / np.pi})[0].designs[0])
    with pytest.raises(ArgumentError, match="continuous designs alone"):
        fl.sweep(scene, {"motion.frequency": [0.5, 1.0]}, loop="digital")


@pytest.mark.parametrize("growth", [3.0, 8.0])
def test_growth_within_a_sample_that_leaves_no_digits_is_named(growth):
    """e^(6 growth) from sample to sample: no actuator would help."""
    system = fl.PeriodicSystem([[growth, 1.0], [0.0, -2.0]], 24.0, B=[[1.1, 0.1], [0.1, 1.1]])
    with pytest.raises(NumericalError, match="within a sample; sample faster"):
        fl.sampled_lqr(system, np.eye(2), np.eye(2), 6.0, delay=2.5)


def test_the_filter_is_the_one_made_by_hand():
    table = SENSORS | {"sample_time": "2 ms", "gyroscopes": "0.1 deg/s", "tip": "1 mm"}
    scene, lin, _ = arm_of(ESTIMATED | {"estimator": table})
    found = scene_sensors(scene, lin, scene.designs[0].estimator)
    sizes = np.array([np.deg2rad(0.02), np.deg2rad(0.1), 0.01, 1e-3, 1e-3])
    np.testing.assert_allclose(np.diag(found.V), sizes**2 * 2e-3)
    t, of = np.array([0.0, 0.4]), fl.control
    parts = of.joint_angles(lin), of.joint_rates(lin), of.bending(scene, lin, 0, 0.0), of.tip_position(lin)
    np.testing.assert_allclose(found.C(t), np.concatenate([part(t) for part in parts], axis=1))
    B = lin.input_matrix(t)
    np.testing.assert_allclose(found.W(t), 1e-4 * 2e-3 * B @ np.swapaxes(B, 1, 2), rtol=1e-12)
    by_hand = kalman_filter(lin.periodic_system(), found.C, found.W, found.V, tol=1e-6)
    np.testing.assert_allclose(found.filter(lin, 1e-6).L(t), by_hand.L(t))
    assert found.names[2] == "curvature of link 1 at 0 in 1/m"
    assert len(found.names) == 5


@pytest.mark.slow
def test_the_report_judges_the_design_with_its_states_estimated_and_exports_both(tmp_path):
    """Separation: the exponents are those of the design and of the filter together."""
    scene = arm_of(ESTIMATED, **{"accuracy.tol": 1e-6})[0]
    found = analyse(scene)
    (loop,) = found.estimated
    assert (loop.name, loop.kind, loop.verdict) == ("LQG, estimated", "lqg", "stable")
    assert loop.floquet.exponents.size == 8
    own = found.designs[0].floquet.exponents
    assert max(np.abs(loop.floquet.exponents - value).min() for value in own) < 1e-4 * np.abs(own).max()
    assert record(found)["estimated"]["LQG, estimated"]["verdict"] == "stable"
    export_all(*plant_and_designs(scene, Clock(scene.accuracy)), tmp_path, 8, scene)
    assert (tmp_path / "c-lqg" / "gain.h").exists()
    assert "[1] curvature of link 1 at 0 in 1/m" in (tmp_path / "c-lqg" / "estimator.h").read_text(encoding="utf-8")


REFUSED = {
    r"designs\.0\.weights\.integrals": INTEGRAL | {"weights": WEIGHTS | {"integrals": "0.2 deg/s"}},
    "sample_time beside": SAMPLED | {"kind": "frozen-lqr"},
    "at least one sensor": ESTIMATED | {"estimator": {"torque": 0.1}},
    "an angle": ESTIMATED | {"estimator": {"encoders": "1 mm/s", "torque": 0.1}},
    "a torque": ESTIMATED | {"estimator": {"encoders": 0.1, "torque": "1 deg"}},
    "less than or equal to 1": ESTIMATED | {"estimator": {"strain": [{"link": 1, "at": 2.0, "noise": 0.1}]}},
    "required": ESTIMATED | {"estimator": {"encoders": 0.1}},
}


@pytest.mark.parametrize("words", REFUSED)
def test_tables_that_do_not_fit_are_refused(words):
    with pytest.raises(SceneError, match=words):
        arm_of(REFUSED[words])


def test_a_sensor_that_the_arm_has_not_is_refused():
    scene, lin, _ = arm_of(ESTIMATED)
    for table, words in (
        ({"strain": [{"link": 3, "noise": 0.1}], "torque": 1.0}, "no flexible link"),
        ({"encoders": [0.1, 0.1], "torque": 1.0}, "2 quantities"),
        ({"encoders": "1 mm", "torque": 1.0}, "another unit"),
    ):
        with pytest.raises(ArgumentError, match=words):
            scene_sensors(scene, lin, EstimatorTable.model_validate(table))
