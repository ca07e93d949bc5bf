"""A scene's design with a sample time: gains, verdict, and what other programs get."""

import numpy as np
import pytest
import scipy.io

import flexlin as fl
from flexlin.analyses import analyse
from flexlin.control import design, gain_source, save
from flexlin.errors import ArgumentError, NumericalError, SceneError
from flexlin.report import record
from tests.control.test_c_controllers import call, library, needs_compiler

TABLE = {
    "name": "digital", "kind": "periodic-lqr", "state_weight": [9.0, 9.0, 0.1, 0.1], "input_weight": [2.0], "sample_time": 0.05
}  # fmt: skip
CHANGES = {"links.0.modes": 1, "designs": [TABLE], "control.feedback": {"kind": "none"}}


def with_design(**changes):
    return fl.load_scene("single-link", {**CHANGES, "designs": [TABLE | changes]})


@pytest.fixture(scope="module")
def scene():
    return with_design()


@pytest.fixture(scope="module")
def plant(scene):
    return fl.linearize(fl.build_manipulator(scene), scene.motion)


@pytest.fixture(scope="module")
def made(scene, plant):
    return design(plant, scene.designs[0])


def test_a_design_of_a_scene_is_that_of_its_plant(plant, made):
    same = fl.sampled_lqr(plant.periodic_system(), np.diag(TABLE["state_weight"]), 2.0, 0.05)
    np.testing.assert_array_equal(made.K(same.instants), same.K)
    np.testing.assert_array_equal(made.floquet().exponents, same.floquet().exponents)
    assert made.kind == "sampled-lqr"
    assert made.error < 1e-9


@pytest.mark.slow
def test_a_report_judges_the_held_torque(scene, made):
    a = analyse(scene)
    block = record(a)["designs"]["digital"]
    assert (block["kind"], block["verdict"]) == ("sampled-lqr", "stable")
    np.testing.assert_allclose(block["exponents"][0].real, made.floquet(1e-8).exponents[0].real, atol=1e-7)
    assert [loop.name for loop in a.loops].count("digital") == 1


@needs_compiler
def test_compiled_gains_are_those_of_the_nearest_sample(plant, made, tmp_path):
    files, count = gain_source(made, plant.period, tmp_path, lin=plant), round(plant.period / 0.05)
    compiled = library(files).gain_matrix
    for phase in [*np.arange(count) / count, 0.3 / count, 0.7 / count, 1 - 0.3 / count]:
        wanted = made.K(np.array([phase * plant.period]))[0, 0]
        np.testing.assert_allclose(call(compiled, phase, size=4), wanted, rtol=1e-15)
    assert "nearest of 40 samples" in next(one for one in files if one.suffix == ".h").read_text()


def test_matlab_gets_the_gains_at_the_samples(plant, made, tmp_path):
    path = save(plant.periodic_system(), tmp_path / "plant.mat", (made,), phases=7, lin=plant)
    held = scipy.io.loadmat(path)["designs"]["samples"][0, 0]
    np.testing.assert_array_equal(np.moveaxis(held, -1, 0), made.K(0.05 * np.arange(40)))
    other = fl.control.save(plant.periodic_system(), tmp_path / "plant.nc", (made,), phases=7, lin=plant)
    assert other.stat().st_size > 0


def test_what_is_not_known_of_held_torques_is_refused(scene, plant):
    with pytest.raises(SceneError, match="sample_time beside"):
        with_design(kind="frozen-lqr")
    with pytest.raises(ArgumentError, match="sample_time ="):
        design(plant, with_design(sample_time=1 / np.pi).designs[0])
    with pytest.raises(ArgumentError, match="continuous designs alone"):
        fl.sweep(scene, {"motion.frequency": [0.5, 1.0]}, loop="digital")


@pytest.mark.parametrize("growth", [3.0, 8.0])
def test_growth_within_a_sample_that_leaves_no_digits_is_named(growth):
    """e^(6 growth) from sample to sample: no actuator would help."""
    system = fl.PeriodicSystem([[growth, 1.0], [0.0, -2.0]], 24.0, B=[[1.1, 0.1], [0.1, 1.1]])
    with pytest.raises(NumericalError, match="within a sample; sample faster"):
        fl.sampled_lqr(system, np.eye(2), np.eye(2), 6.0, delay=2.5)
