"""Sweeps of every loop, of models written in Python, and over values that a scene or its equations refuse."""

import casadi as ca
import numpy as np
import pytest
from pydantic import BaseModel

import flexlin as fl
from flexlin.analyses import choose_loop
from flexlin.control import design
from flexlin.errors import ArgumentError, ModelError, SceneError
from flexlin.linearization import ParametricLoop
from flexlin.scene import register_model, revise_scene
from tests.closed_arm import control_loop
from tests.mechanics.scenes import linear

PAYLOAD = "effects.payload.mass"
WEIGHTS = {"state_weight": [100.0, 100.0, 1.0, 1.0], "input_weight": [0.1]}
LQR = {"name": "LQR", "kind": "periodic-lqr", **WEIGHTS}
SMALL = {"links.0.modes": 1, "designs": [LQR]}


def plant_of(scene):
    return linear(scene).periodic_system()


def moving(joints, **parts):
    motion = {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.3}] * joints}
    return {"schema": 1, "title": "moving", "motion": motion, **parts}


def largest_gap(found, exact):
    return float(np.abs(found[:, None] - exact.exponents).min(axis=1).max())


@pytest.mark.slow
@pytest.mark.parametrize(("path", "values"), [(PAYLOAD, [0.01, 0.1]), ("motion.frequency", [0.4, 0.9])])
def test_each_loop_agrees_with_one_built_by_hand(path, values):
    scene = fl.load_scene("single-link", SMALL)
    kept, T = design(plant_of(scene), scene.designs[0]), 1 / scene.motion.frequency
    loops = {
        "own": lambda s: control_loop(s).periodic_system(),
        "open": plant_of,
        "LQR": lambda s: plant_of(s).feedback(lambda t: kept.K(t * T * s.motion.frequency)),
        "LQR, redone": lambda s: design(plant_of(s), s.designs[0]).closed_loop,
    }
    for name, build in loops.items():
        data = fl.sweep(scene, {path: values}, 1e-8, loop=name)
        assert data.attrs["loop"] == name
        for i, value in enumerate(values):
            exact = fl.floquet(build(revise_scene(scene, {path: value})), 1e-10)
            assert largest_gap(data["exponents"].values[i], exact) <= 2e-8 * np.abs(exact.exponents).max(), name
            assert data["verdict"].values[i] == exact.verdict


@pytest.mark.slow
def test_a_model_written_in_python_is_swept_by_symbols_or_rebuilt_at_each_value():
    """A pendulum whose code takes symbols, one that refuses them, and one that means something else with them."""

    class Table(BaseModel):
        length: float

    def build(length):
        q, rate = ca.SX.sym("q"), ca.SX.sym("rate")
        return fl.Manipulator.from_lagrangian(q, rate, (length * rate) ** 2 / 2, -9.81 * length * ca.cos(q))

    register_model("swept pendulum", Table, lambda p: build(p.length))
    register_model("counting pendulum", Table, lambda p: build(float(p.length)))
    register_model("lying pendulum", Table, lambda p: build(p.length if isinstance(p.length, float) else 2 * p.length))
    control = {"feedback": {"kind": "pd", "kp": [3.0], "kd": [0.4]}}
    for model, alone in (("swept pendulum", 0), ("counting pendulum", 2), ("lying pendulum", 2)):
        scene = fl.parse_scene(moving(1, model=model, parameters={"length": 1}, control=control))
        data = fl.sweep(scene, {"parameters.length": [0.5, 0.8]})
        assert data.attrs["one_by_one"] == alone
        long = revise_scene(scene, {"parameters.length": 0.8})
        assert largest_gap(data["exponents"].values[1], fl.floquet(control_loop(long).periodic_system())) < 3e-8
    with pytest.raises(ArgumentError, match="registered in this process only"):
        fl.sweep(scene, {"parameters.length": np.linspace(0.5, 0.8, 2000)}, workers=2)


def test_a_value_that_the_scene_refuses_is_named_before_anything_is_computed(monkeypatch):
    for name, path, values, key in (
        ("single-link", PAYLOAD, [*np.linspace(0.0, 1.0, 3000), -1e-9], "effects.payload.mass: got -1e-09"),
        ("single-link", "motion.frequency", [1.0, 1e-40], "motion.frequency"),
        ("khang-2019", "parameters.payload_mass", [0.1, -0.1], r"parameters\.payload_mass: got -0\.1"),
    ):
        monkeypatch.setattr("flexlin.analyses.sweep.job.choose_loop", lambda *_: pytest.fail("computed"))
        with pytest.raises(SceneError, match=key):
            fl.sweep(fl.load_scene(name), {path: values})


@pytest.mark.slow
def test_lengths_of_a_closed_loop_are_symbols_and_move_its_closure():
    """Two lengths of the five-bar at once against scenes that are built with them; where the loop cannot be closed the value is marked."""
    scene = fl.load_scene("five-bar", {"designs": []})
    pairs = np.array([[0.29, 0.15], [0.32, 0.15], [0.3, 0.17], [0.31, 0.9]])
    paths = ("links.1.length", "links.2.mount.xyz.0")
    data = fl.sweep(scene, dict(zip(paths, pairs.T, strict=True)), grid=False)
    assert isinstance(choose_loop(scene, paths), ParametricLoop)  # few values of so many states are taken from it alone
    for values, found in zip(pairs[:3], data["exponents"].values, strict=False):
        other = revise_scene(scene, dict(zip(paths, map(float, values), strict=True)))
        assert largest_gap(found, fl.floquet(control_loop(other).periodic_system())) < 1e-7
    assert data["verdict"].values.tolist() == ["stable"] * 3 + ["failed"]


@pytest.mark.parametrize("modes", [0, 1])
def test_values_that_linearize_refuses_are_not_judged(modes):
    """A rotor's spin without the squares that go with it makes M indefinite: Floquet called such loops unstable, or stable."""
    link = {"length": 0.5, "mass_per_length": 0.2, "bending_stiffness": 1.0, "modes": modes}
    spin = {"inertia": [0.0, 1e-8], "gear_ratio": [0.0, 100.0]}
    loop = {"feedforward": "rigid", "feedback": {"kind": "pd", "kp": [4.0, 2.0], "kd": [1.5, 0.6]}}
    scene = fl.parse_scene(moving(2, links=[link] * 2, control=loop, effects={"rotor_spin": spin}))
    path, values = "effects.rotor_spin.inertia.1", np.geomspace(1e-7, 1e-2, 12)
    data = fl.sweep(scene, {path: values})
    for value, verdict, reason in zip(values.tolist(), data["verdict"].values, data["reason"].values, strict=True):
        other = revise_scene(scene, {path: value})
        if verdict == "failed":
            assert np.isnan(data["exponents"].values[values == value]).all()
            assert f"{path} = {value:.6g}" in reason
            with pytest.raises(ModelError, match="M is not positive definite"):
                control_loop(other)
        else:
            assert fl.floquet(control_loop(other).periodic_system()).verdict == verdict
    assert {"stable", "failed"} == set(data["verdict"].values)
    with pytest.raises(ModelError, match=path):
        fl.critical_values(scene, path, (1e-3, 1e-2))


def test_loops_that_are_not_there_are_refused():
    scene = fl.load_scene("single-link", SMALL)
    with pytest.raises(ArgumentError, match=r"own .* open .* LQR"):
        fl.sweep(scene, {PAYLOAD: [0.1]}, loop="lqr")
    with pytest.raises(ArgumentError, match="no part in this loop"):
        fl.sweep(scene, {"control.feedback.kp.0": [1.0]}, loop="open")


def test_a_design_in_physical_sizes_is_made_anew_at_each_value():
    """Its weights go through the tip's map, which moves with the numbers that vary."""
    weights = {"tip": "5 mm", "rates": "10 deg/s", "input": "0.3 N m"}
    tables = [{"name": "LQR", "kind": "periodic-lqr", "weights": weights}]
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": tables})
    data = fl.sweep(scene, {"links.0.length": [0.8, 1.1]}, 1e-7, loop="LQR, redone")
    for found, length in zip(data["exponents"].values, (0.8, 1.1), strict=True):
        other = revise_scene(scene, {"links.0.length": length})
        exact = fl.floquet(design(linear(other), other.designs[0]).closed_loop)
        assert largest_gap(found, exact) <= 2e-6 * np.abs(exact.exponents).max()
