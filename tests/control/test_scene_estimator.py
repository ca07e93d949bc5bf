"""An estimator that a scene describes: its sensors, its noise, its verdict beside the design's own."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import Clock, analyse, plant_and_designs
from flexlin.control import kalman_filter, scene_sensors
from flexlin.errors import ArgumentError, SceneError
from flexlin.report import export_all, record
from flexlin.scene import EstimatorTable

WEIGHTS = {"joints": "1 deg", "rates": "20 deg/s", "deflection": "10 mm", "input": "0.3 N m"}
STRAIN = [{"link": 1, "noise": "0.01 1/m"}]
TABLE = {"encoders": "0.02 deg", "strain": STRAIN, "torque": "10 mN m", "sample_time": "2 ms"}


def scene_with(estimator, **more):
    design = {"name": "LQG", "kind": "periodic-lqr", "weights": WEIGHTS, "estimator": estimator}
    return fl.load_scene("single-link", {"links.0.modes": 1, "designs": [design], "accuracy.tol": 1e-6, **more})


def test_the_filter_is_the_one_made_by_hand():
    scene = scene_with({**TABLE, "gyroscopes": "0.1 deg/s", "tip": "1 mm"})
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    found = scene_sensors(scene, lin, scene.designs[0].estimator)
    sizes = np.array([np.deg2rad(0.02), np.deg2rad(0.1), 0.01, 1e-3, 1e-3])
    np.testing.assert_allclose(np.diag(found.V), sizes**2 * 2e-3)
    t = np.array([0.0, 0.4])
    of = fl.control
    parts = of.joint_angles(lin), of.joint_rates(lin), of.bending(scene, lin, 0, 0.0), of.tip_position(lin)
    np.testing.assert_allclose(found.C(t), np.concatenate([part(t) for part in parts], axis=1))
    B = lin.input_matrix(t)
    np.testing.assert_allclose(found.W(t), 1e-4 * 2e-3 * B @ np.swapaxes(B, 1, 2), rtol=1e-12)
    by_hand = kalman_filter(lin.periodic_system(), found.C, found.W, found.V, tol=1e-6)
    np.testing.assert_allclose(found.filter(lin, 1e-6).L(t), by_hand.L(t))
    assert found.names[2] == "curvature of link 1 at 0 in 1/m"
    assert len(found.names) == 5


@pytest.mark.slow
def test_the_report_judges_the_design_with_its_states_estimated():
    """Separation: the exponents are those of the design and of the filter together."""
    found = analyse(scene_with(TABLE))
    (loop,) = found.estimated
    assert (loop.name, loop.kind, loop.verdict) == ("LQG, estimated", "lqg", "stable")
    assert loop.floquet.exponents.size == 8
    own = found.designs[0].floquet.exponents
    assert max(np.abs(loop.floquet.exponents - value).min() for value in own) < 1e-4 * np.abs(own).max()
    assert record(found)["estimated"]["LQG, estimated"]["verdict"] == "stable"


@pytest.mark.slow
def test_the_export_writes_the_filter_beside_the_gain(tmp_path):
    scene = scene_with(TABLE)
    plant, loops = plant_and_designs(scene, Clock())
    export_all(plant, loops, tmp_path, 8, scene)
    header = (tmp_path / "c-lqg" / "estimator.h").read_text(encoding="utf-8")
    assert "[0] encoder of q1 in rad" in header
    assert "[1] curvature of link 1 at 0 in 1/m" in header
    assert (tmp_path / "c-lqg" / "gain.h").exists()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"torque": 0.1}, "at least one sensor"),
        ({"encoders": "1 mm/s", "torque": 0.1}, "an angle"),
        ({"encoders": 0.1, "torque": "1 deg"}, "a torque"),
        ({"strain": [{"link": 1, "at": 2.0, "noise": 0.1}], "torque": 1.0}, "less than or equal to 1"),
        ({"encoders": 0.1}, "required"),
    ],
)
def test_tables_that_say_nothing_are_refused(table, words):
    with pytest.raises(SceneError, match=words):
        scene_with(table)


def test_a_sensor_that_the_arm_has_not_is_refused():
    scene = scene_with(TABLE)
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion)
    for table, words in (
        ({"strain": [{"link": 3, "noise": 0.1}], "torque": 1.0}, "no flexible link"),
        ({"encoders": [0.1, 0.1], "torque": 1.0}, "2 quantities"),
        ({"encoders": "1 mm", "torque": 1.0}, "another unit"),
    ):
        with pytest.raises(ArgumentError, match=words):
            scene_sensors(scene, lin, EstimatorTable.model_validate(table))
