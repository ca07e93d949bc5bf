"""Sweeps over scene parameters, against scenes built anew for each value; any real number of any built-in scene is swept, or refused."""

import numpy as np
import pytest

import flexlin as fl
from flexlin import sweep
from flexlin.analyses import choose_loop
from flexlin.errors import ArgumentError, InputError
from flexlin.scene import get_value, numeric_paths, replace_value, revise_scene
from tests.closed_arm import control_loop
from tests.memory import at_most
from tests.thinned import thin

SMALL, MASS = {"links.0.modes": 1, "designs": []}, "effects.payload.mass"
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


KINDS = {
    "motion.frequency": (0.3, 1.5),
    MASS: (0.01, 0.2),
    "control.feedback.kp.0": (1, 8),
    "motion.move_time": (0.4, 0.6),
}


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
    paths = {MASS: [0.02, 0.05, 0.1], "control.feedback.kp.0": [2.0, 3.0, 4.0]}
    points, grid = sweep(scene, paths), sweep(scene, paths, grid=True)
    assert points.exponents.shape == (3, 4)
    assert grid.verdict.dims == tuple(paths)
    diagonal = grid.exponents.values[np.arange(3), np.arange(3)]
    assert np.allclose(diagonal, points.exponents.values, rtol=2e-8, atol=0)
    chosen = grid.sel({MASS: 0.05, "control.feedback.kp.0": 3.0})
    assert np.allclose(chosen.exponents, points.exponents[1], rtol=2e-8, atol=0)


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
