"""Sweeps over scene parameters, against scenes built anew for each value: of every loop, of models written in Python, of any real number of
any built-in scene, and over values that a scene or its equations refuse."""

import casadi as ca
import numpy as np
import pytest
from pydantic import BaseModel

import flexlin as fl
from flexlin import sweep
from flexlin.analyses import choose_loop
from flexlin.control import design
from flexlin.errors import ArgumentError, InputError, ModelError, SceneError
from flexlin.linearization import ParametricLoop
from flexlin.scene import get_value, numeric_paths, register_model, replace_value, revise_scene
from tests.closed_arm import control_loop
from tests.mechanics.scenes import linear
from tests.memory import at_most
from tests.thinned import thin

SMALL = {"links.0.modes": 1, "designs": []}
MASS, GAIN = "effects.payload.mass", "control.feedback.kp.0"
MOVES = {"kind": "point-to-point", "move_time": 0.4, "dwell_time": 0.1, "joints": [{"waypoints": [0.0, 1.0, 0.4]}]}


@pytest.fixture(scope="module")
def scene():
    return fl.load_scene("single-link", SMALL)


def rebuilt(scene, path, value):
    return fl.floquet(control_loop(replace_value(scene, path, float(value))).periodic_system(), 1e-11)


def compare(found, i, exact, least):
    """Each exponent of a value lies within both errors of one that is known; the error is at most `least` of its size."""
    apart = np.abs(found.exponents.values[i][:, None] - exact.exponents).min(axis=1)
    assert np.all(apart <= float(found.error[i]) + exact.error)
    assert np.all(apart <= least * np.maximum(1.0, np.abs(exact.exponents)))
    assert str(found.verdict.values[i]) == exact.verdict


KINDS = {"motion.frequency": (0.3, 1.5), MASS: (0.01, 0.2), GAIN: (1, 8), "motion.move_time": (0.4, 0.6)}


@pytest.mark.parametrize("path", thin(KINDS))
def test_every_kind_of_parameter_agrees_with_a_scene_built_anew(path):
    """The equations of a motion whose breaks move are derived anew at each value."""
    scene = fl.load_scene("single-link", SMALL | ({"motion": MOVES} if path == "motion.move_time" else {}))
    values = np.linspace(*KINDS[path], 40)
    result = sweep(scene, {path: values})
    for i in (0, 13, 27, 39):
        compare(result, i, rebuilt(scene, path, values[i]), 2e-8)


def test_the_arm_is_kept_only_while_the_motion_alone_varies():
    """Else a payload beside the time of a move would be that of the scene."""
    scene = fl.load_scene("single-link", SMALL | {"motion": MOVES})
    loop, t = choose_loop(scene, ("motion.move_time", MASS)), np.linspace(0.0, 1.0, 7)
    for mass in (0.03, 0.09):
        exact = replace_value(replace_value(scene, "motion.move_time", 0.5), MASS, mass)
        A = loop.system_at(np.array([0.5, mass])).A(t)
        np.testing.assert_allclose(A, control_loop(exact).periodic_system().A(t), rtol=1e-9, atol=1e-9)
    alone = choose_loop(scene, ("motion.move_time",))
    assert alone.at(np.array([0.5])).arm is alone.at(np.array([0.6])).arm


@pytest.mark.parametrize("harmonic", thin([16, 64]))
def test_harmonics_that_samples_of_the_coefficients_take_for_others_are_seen(harmonic):
    """13 phases take the harmonic 16 of a shaking joint for 3: growth rates were off by 1e-6 (64: 1e-3) with errors of 6e-8."""
    sine = [0.3, *[0.0] * (harmonic - 2), 0.4 / harmonic]
    motion = {"kind": "fourier", "period": 2.0, "joints": [{"mean": 0.0, "cos": [0.0] * harmonic, "sin": sine}]}
    shaken, values = fl.load_scene("single-link", SMALL | {"motion": motion}), np.linspace(0.01, 0.3, 9)
    result = sweep(shaken, {MASS: values})
    for i in (0, 5):
        compare(result, i, rebuilt(shaken, MASS, values[i]), 1e-6)


def test_two_paths_make_points_or_a_grid(scene):
    paths = {MASS: [0.02, 0.05, 0.1], GAIN: [2.0, 3.0, 4.0]}
    points, grid = sweep(scene, paths), sweep(scene, paths, grid=True)
    assert (points.exponents.shape, grid.verdict.dims) == ((3, 4), tuple(paths))
    diagonal = grid.exponents.values[np.arange(3), np.arange(3)]
    assert np.allclose(diagonal, points.exponents.values, rtol=2e-8, atol=0)


def test_more_workers_than_blocks_are_none(scene):
    found, alone = (sweep(scene, {MASS: [0.02, 0.05, 0.1]}, workers=count) for count in (10**20, 1))
    np.testing.assert_array_equal(found.exponents, alone.exponents)


@pytest.mark.slow
def test_memory_is_little_more_than_the_results(scene):
    values = np.linspace(0.01, 0.2, 20_000)
    few = sweep(scene, {MASS: values[:5]})
    with at_most(4 * len(values) / 5 * few.nbytes + 2**22):
        sweep(scene, {MASS: values}, workers=1)


def test_values_that_the_kernel_cannot_certify_go_one_by_one(scene, monkeypatch):
    """With few segments no error estimate can be small: the kernel must say so and hand over."""
    few = {"SEGMENT_NUMBERS": np.array([1, 2]), "FEWEST_SEGMENTS": 1, "MOST_SEGMENTS": 2}
    for name, value in few.items():
        monkeypatch.setattr(f"flexlin.analyses.sweep.together.{name}", value)
    result = sweep(scene, {MASS: [0.03, 0.05]})
    assert result.attrs["one_by_one"] == 2
    assert result.one_by_one.all()
    compare(result, 1, rebuilt(scene, MASS, 0.05), 1e-8)


def test_what_does_not_fit_is_refused(scene):
    for values in ({}, {MASS: []}, {MASS: [0.1], "motion.frequency": [1.0, 2.0]}, {"links.0.x": [1.0]}):
        with pytest.raises(ArgumentError):
            sweep(scene, values)


LEFT_OUT = ("accuracy", "designs", "uncertainty")


@pytest.mark.slow
def test_numbers_of_built_in_scenes_are_swept_or_refused():
    """Each scene as often as any other."""
    rng, names = np.random.default_rng(11), sorted(fl.scenes())
    for _ in range(8):
        scene = fl.load_scene(names[rng.integers(len(names))])
        paths = [path for path in numeric_paths(scene) if not path.startswith(LEFT_OUT)]
        path = paths[rng.integers(len(paths))]
        own = get_value(scene, path)
        values = own * np.array([0.9, 1.0, 1.1]) if own else np.array([-0.05, 0.0, 0.05])
        try:
            found = fl.sweep(scene, {path: values}, 1e-8, workers=1)
        except InputError:
            assert not own or path.startswith(("links", "loops")), (scene.title, path)  # others may change by a tenth
            continue
        result = fl.floquet(control_loop(scene).periodic_system(), 1e-10)
        assert str(found.verdict.values[1]) == result.verdict, (scene.title, path)
        apart = np.abs(found.exponents.values[1].real - result.exponents.real).max()
        scale = np.maximum(1.0, np.abs(result.exponents).max())
        assert apart <= float(found.error[1]) + result.errors.max() + 1e-8 * scale, (scene.title, path)


def test_numbers_of_lists_that_a_scene_leaves_out_can_be_set():
    scene = fl.load_scene("arm-on-carriage")
    paths = {"links.0.mount.xyz.2": 0.01, "links.0.mount.xyz.0": 0.03, "effects.gravity.direction.2": 0.1}
    revised = revise_scene(scene, paths)
    assert [get_value(revised, path) for path in paths] == list(paths.values())
    assert get_value(revised, "links.0.mount.xyz.1") == get_value(scene, "links.0.mount.xyz.1")
    assert get_value(revised, "effects.gravity.direction.1") == get_value(scene, "effects.gravity.direction.1")


WEIGHTS = {"tip": "5 mm", "rates": "10 deg/s", "input": "0.3 N m"}
WITH_LQR = {"links.0.modes": 1, "designs": [{"name": "LQR", "kind": "periodic-lqr", "weights": WEIGHTS}]}


def plant_of(scene):
    return linear(scene).periodic_system()


def moving(joints, **parts):
    motion = {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.3}] * joints}
    return {"schema": 1, "title": "moving", "motion": motion, **parts}


def largest_gap(found, exact):
    return float(np.abs(found[:, None] - exact.exponents).min(axis=1).max())


VARIED = [(MASS, [0.01, 0.1]), ("motion.frequency", [0.4, 0.9]), ("links.0.length", [0.8, 1.1])]


@pytest.mark.slow
@pytest.mark.parametrize(("path", "values"), VARIED)
def test_each_loop_agrees_with_one_built_by_hand(path, values):
    """A design's weights go through the tip's map, which moves with the numbers that vary."""
    scene = fl.load_scene("single-link", WITH_LQR)
    kept, T = design(linear(scene), scene.designs[0]), 1 / scene.motion.frequency
    loops = {
        "own": lambda s: control_loop(s).periodic_system(),
        "open": plant_of,
        "LQR": lambda s: plant_of(s).feedback(lambda t: kept.K(t * T * s.motion.frequency)),
        "LQR, redone": lambda s: design(linear(s), s.designs[0]).closed_loop,
    }
    for name, build in loops.items():
        data = fl.sweep(scene, {path: values}, 1e-8, loop=name)
        assert data.attrs["loop"] == name
        for i, value in enumerate(values):
            compare(data, i, fl.floquet(build(revise_scene(scene, {path: value})), 1e-10), 2e-8)


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
        ("single-link", MASS, [*np.linspace(0.0, 1.0, 3000), -1e-9], "effects.payload.mass: got -1e-09"),
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
    scene = fl.load_scene("single-link", WITH_LQR)
    with pytest.raises(ArgumentError, match=r"own .* open .* LQR"):
        fl.sweep(scene, {MASS: [0.1]}, loop="lqr")
    with pytest.raises(ArgumentError, match="no part in this loop"):
        fl.sweep(scene, {GAIN: [1.0]}, loop="open")
