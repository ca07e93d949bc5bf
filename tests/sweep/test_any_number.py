"""Any real number of any built-in scene can be charted: three values around its own are answered, or refused with the key."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import InputError
from flexlin.scene import get_value, numeric_paths, revise_scene
from tests.closed_arm import control_loop

LEFT_OUT = ("accuracy", "designs", "uncertainty")


def draw(count, seed=11):
    """Scenes and paths of numbers, each scene as often as any other."""
    rng, names = np.random.default_rng(seed), sorted(fl.scenes())
    for _ in range(count):
        scene = fl.load_scene(names[rng.integers(len(names))])
        paths = [path for path in numeric_paths(scene) if not path.startswith(LEFT_OUT)]
        yield scene, paths[rng.integers(len(paths))]


@pytest.mark.slow
def test_numbers_are_swept_or_refused():
    for scene, path in draw(8):
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
