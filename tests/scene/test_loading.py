"""Scenes: all problems at once, each with key, got and expected; overrides; nothing evaluated."""

import copy
import functools
import operator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import flexlin as fl
from flexlin.errors import ArgumentError, SceneError
from flexlin.scene import apply_overrides, get_value, label_number, numeric_paths, parse_assignment, replace_value

GOOD = {
    "schema": 1,
    "title": "good",
    "links": [{"length": 1.0, "mass_per_length": 0.3, "bending_stiffness": 2.0, "modes": 2}],
    "effects": {"gravity": {}, "payload": {"mass": 0.1}},
    "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.5}]},
    "control": {"feedback": {"kind": "pd", "kp": [1.0], "kd": [0.1]}},
}


def with_change(path, value):
    raw = copy.deepcopy(GOOD)
    *steps, last = (int(step) if step.isdigit() else step for step in path.split("."))
    functools.reduce(operator.getitem, steps, raw)[last] = value
    return raw


@pytest.mark.parametrize("name", sorted(fl.scenes()))
def test_shipped_scenes_load(name):
    scene = fl.load_scene(name)
    assert scene.title == fl.scenes()[name]
    assert scene.source


def test_scenes_are_frozen():
    with pytest.raises(ValidationError):
        fl.parse_scene(GOOD).title = "other"


def test_numbers_of_numpy_are_python_s_own():
    """A study's loop gives np.arange's whole numbers, and gains as arrays, whose length must be looked at too."""
    found = fl.load_scene("single-link", {"links.0.modes": np.int64(3), "control.feedback.kp": np.array([5.0])})
    assert (found.links[0].modes, found.control.feedback.kp) == (3, (5.0,))
    for path, value, words in (
        ("control.feedback.kp", np.ones(2), "got 2 numbers, expected 1"),
        ("links.0.length", np.float64(-1), "got -1.0"),
        ("links.0.length", np.uint64(2**63), "beyond 64 bits"),
    ):
        with pytest.raises(SceneError, match=words):
            fl.load_scene("single-link", {path: value})


def test_an_effect_is_switched_by_its_whole_table():
    on = fl.parse_scene(GOOD, overrides={"effects.hub": {"inertia": 0.1}})
    assert on.effects.hub.inertia == 0.1
    assert fl.parse_scene(GOOD, overrides={"effects.payload": "off"}).effects.payload is None
    with pytest.raises(SceneError, match="effect that is off"):
        fl.parse_scene(GOOD, overrides={"effects.hub.inertia": 0.1})


def test_an_override_into_a_list_that_is_not_there_is_answered_by_the_keys_that_are():
    with pytest.raises(SceneError, match="a key of the scene: schema, title, source, links"):
        fl.load_scene("five-bar", {"left.1.modes": 1})


def test_keys_of_a_model_s_table_may_go_without_their_prefix():
    whole = fl.load_scene("khang-2019", {"parameters.links.0.modes": 3, "parameters.payload_mass": 0.2})
    short = fl.load_scene("khang-2019", {"links.0.modes": 3, "payload_mass": 0.2})
    assert short == whole
    assert get_value(short, "links.0.length") == get_value(short, "parameters.links.0.length") == 1.0
    assert label_number(short, "links.0.length") == "length of link 1 in m"
    assert label_number(short, "payload_mass") == "payload mass in kg"
    assert fl.build_manipulator(short, ["links.0.length"]).parameters.paths == ("parameters.links.0.length",)
    with pytest.raises(SceneError, match="a key of the model's own table: hub_inertia, payload_mass"):
        fl.load_scene("khang-2019", {"effects.payload.mass": 0.2})
    with pytest.raises(ArgumentError, match=r"nothing at 'links\.0\.lenght'"):
        get_value(short, "links.0.lenght")


def test_a_key_that_the_scene_has_is_never_one_of_its_model_s_table():
    raw = {"schema": 1, "title": "x", "model": "own", "parameters": {"title": 1.0, "units": 2.0, "links": []}}
    scene = fl.parse_scene({**raw, "motion": GOOD["motion"]}, overrides={"title": "y", "parameters.title": 3.0})
    assert (scene.title, scene.parameters["title"]) == ("y", 3.0)
    assert get_value(scene, "motion.frequency") == GOOD["motion"]["frequency"]


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("effects.payload.mass=0.3", "effects.payload.mass", 0.3),
        ("links.0.modes = 3", "links.0.modes", 3),
        ("effects.hub={inertia=0.1}", "effects.hub", {"inertia": 0.1}),
        ("motion.kind=rotation", "motion.kind", "rotation"),
        ("title=a=b", "title", "a=b"),
    ],
)
def test_assignments(text, key, value):
    assert parse_assignment(text) == (key, value)


@given(st.floats(min_value=1e-6, max_value=1e6))
def test_override_equals_edited_file(mass):
    edited, override = with_change("effects.payload.mass", mass), {"effects.payload.mass": mass}
    assert fl.parse_scene(GOOD, overrides=override) == fl.parse_scene(edited)
    assert apply_overrides(GOOD, override)[0] == edited


def test_numbers_by_path():
    scene = fl.parse_scene(GOOD)
    paths = numeric_paths(scene)
    assert {"links.0.length", "effects.payload.mass", "motion.joints.0.amplitude", "control.feedback.kp.0"} <= {*paths}
    assert "links.0.modes" not in paths
    for path in paths:
        changed = replace_value(scene, path, 12.5)
        assert get_value(changed, path) == 12.5
        assert get_value(scene, path) != 12.5
    with pytest.raises(ArgumentError, match="nothing at"):
        get_value(scene, "effects.hub.inertia")


def build_own(model, parameters=None):
    """The arm of a model's name."""
    raw = {"schema": 1, "title": "x", "model": model, "parameters": parameters or {}, "motion": GOOD["motion"]}
    return fl.build_manipulator(fl.parse_scene(raw))


def test_nothing_is_evaluated():
    with pytest.raises(SceneError, match="registered model"):
        build_own("os.system")
    with pytest.raises(SceneError, match="expected a number"):
        fl.parse_scene(with_change("links.0.length", "__import__('os').getcwd()"))


def test_a_registered_model_checks_its_parameters():
    with pytest.raises(SceneError) as caught:
        build_own("khang-2019", {"length": -1.0})
    assert {"parameters.length", "parameters.links"} <= {problem.key for problem in caught.value.problems}
