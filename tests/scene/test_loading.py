"""Scenes: overrides, numbers by their paths and with their units; nothing evaluated.

What no arm can have is refused alike wherever it comes in: TOML, URDF, CSV, JSON, --set, quantities with units, ranges of a chart.
"""

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import flexlin as fl
from flexlin.bounds import LARGEST_NUMBER, LONGEST_NUMBER, read_number
from flexlin.cli import main
from flexlin.errors import ArgumentError, SceneError
from flexlin.scene import dimension_of, get_value, in_si, label_number, numeric_paths, parse_assignment, replace_value
from tests.mechanics.scenes import plain_scene, swinging
from tests.torture.accidents import ROBOT
from tests.torture.scenes import sampled_cycle

GOOD = {
    "schema": 1,
    "title": "good",
    "links": [{"length": 1.0, "mass_per_length": 0.3, "bending_stiffness": 2.0, "modes": 2}],
    "effects": {"gravity": {}, "payload": {"mass": 0.1}},
    "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.5}]},
    "control": {"feedback": {"kind": "pd", "kp": [1.0], "kd": [0.1]}},
}


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
    with pytest.raises(ArgumentError, match=r"nothing at 'links\.0\.lenght'.*did you mean 'length'"):
        get_value(short, "links.0.lenght")


def test_a_key_that_the_scene_has_is_never_one_of_its_model_s_table():
    raw = {"schema": 1, "title": "x", "model": "own", "parameters": {"title": 1.0, "units": 2.0, "links": []}}
    scene = fl.parse_scene({**raw, "motion": GOOD["motion"]}, overrides={"title": "y", "parameters.title": 3.0})
    assert (scene.title, scene.parameters["title"]) == ("y", 3.0)
    assert get_value(scene, "motion.frequency") == GOOD["motion"]["frequency"]


def test_assignments():
    for text, key, value in (
        ("effects.payload.mass=0.3", "effects.payload.mass", 0.3),
        ("links.0.modes = 3", "links.0.modes", 3),
        ("effects.hub={inertia=0.1}", "effects.hub", {"inertia": 0.1}),
        ("motion.kind=rotation", "motion.kind", "rotation"),
        ("title=a=b", "title", "a=b"),
    ):
        assert parse_assignment(text) == (key, value)


@given(st.floats(min_value=1e-6, max_value=1e6))
def test_override_equals_edited_file(mass):
    edited, override = GOOD | {"effects": {"gravity": {}, "payload": {"mass": mass}}}, {"effects.payload.mass": mass}
    assert fl.parse_scene(GOOD, overrides=override) == fl.parse_scene(edited)


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
    with pytest.raises(ArgumentError, match=r"one of schema, .* did you mean 'units'"):
        get_value(scene, "unitz")


def build_own(model, parameters=None):
    """The arm of a model's name."""
    raw = {"schema": 1, "title": "x", "model": model, "parameters": parameters or {}, "motion": GOOD["motion"]}
    return fl.build_manipulator(fl.parse_scene(raw))


def test_nothing_is_evaluated():
    with pytest.raises(SceneError, match="registered model"):
        build_own("os.system")
    with pytest.raises(SceneError, match="expected a number"):
        fl.parse_scene(GOOD, overrides={"links.0.length": "__import__('os').getcwd()"})


def test_a_registered_model_checks_its_parameters():
    with pytest.raises(SceneError) as caught:
        build_own("khang-2019", {"length": -1.0})
    assert {"parameters.length", "parameters.links"} <= {problem.key for problem in caught.value.problems}


SAME = [
    ("2 mm", "m", 2e-3), ("-1.5e1cm", "m", -0.15), ("0.3", "m", 0.3), (0.3, "m", 0.3), ("80 mm/s", "m/s", 0.08), ("20 ms", "s", 0.02),
    ("0.5 deg", "rad", math.pi / 360), ("30 rpm", "rad/s", math.pi), ("90 deg/s", "rad/s", math.pi / 2), (2, "rad/s", 2.0),
    ("3 N m", "N m", 3.0), ("3 Nm", "N m", 3.0), ("3 N*m", "N m", 3.0), ("250 mN m", "N m", 0.25), ("1 J", "N m", 1.0),
    ("12 V A", "W", 12.0), ("1 kg m^2/s^2", "N m", 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("text", "unit", "value"), SAME)
def test_quantities_in_si(text, unit, value):
    assert in_si(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["2 deg", "2 s", "2 m/s", "2 m m", "m", "", "2 mn", "nan m", "inf", "1e999x m", True, None, [1.0], "2 m/"]
)
def test_what_is_no_length_is_refused(text):
    with pytest.raises(ValueError, match="a length such as 2 mm"):
        in_si(text, "m")


@pytest.mark.parametrize(
    ("unit", "same"), [("ohm", "V/A"), ("B", "MB"), ("N m/(rad s)", "N m/rad/s"), ("N/(m s)", "N/m/s")]
)
def test_the_unit_that_a_key_states_can_be_written(unit, same):
    """The JSON schema allowed texts for these keys, and none could be read."""
    assert dimension_of(unit) == (1.0, dimension_of(same)[1])


@pytest.mark.parametrize("unit", ["N m/(rad s", "N m/rad s)", "()", "(m)(m)"])
def test_brackets_come_in_pairs(unit):
    with pytest.raises(ValueError, match="a known unit"):
        dimension_of(unit)


def test_dimensions_of_products_and_quotients_agree():
    """W = N m / s = V A, and an angle is a dimension of its own."""
    assert dimension_of("W")[1] == dimension_of("N m/s")[1] == dimension_of("V A")[1]
    assert dimension_of("deg/s")[1] != dimension_of("1/s")[1]


WRITTEN = {
    "links.0.length": ("960 mm", 0.96),
    "links.0.bending_stiffness": ("3.6866e6 N mm^2", 3.6866),
    "links.0.mass_per_length": ("1.6486 g/cm", 0.16486),
    "effects.hub.inertia": ("5859.8 g cm^2", 5.8598e-4),
    "motion.frequency": ("500 mHz", 0.5),
    "accuracy.memory": ("500 MB", 5e8),  # refused, though the JSON schema allowed such a text
    "motion.joints.0.amplitude": ("30 deg", math.pi / 6),
    "control.feedback.kp.0": ("3000 mN m/rad", 3.0),
    "accuracy.seconds": ("1 min", 60.0),
}
"""Of conversions by hand."""


@pytest.mark.parametrize("path", WRITTEN)
def test_a_number_of_a_scene_may_carry_its_unit(path):
    text, value = WRITTEN[path]
    assert get_value(fl.load_scene("single-link", {path: text}), path) == pytest.approx(value, rel=1e-12)


def moved(amplitude, *kinds):
    """Rigid links on these joints, those that move by an amplitude."""
    links = [{"length": 0.3, "mass_per_length": 1.0, "modes": 0, "joint": kind} for kind in kinds]
    return plain_scene(links, swinging(*[{"amplitude": amplitude} for kind in kinds if kind != "fixed"]))


KNOWN = [("prismatic", "20 mm", 0.02, "20 deg"), ("revolute", "20 deg", math.pi / 9, "20 mm")]


@pytest.mark.parametrize(("kind", "amplitude", "value", "other"), KNOWN)
def test_an_amplitude_has_the_unit_of_its_joint(kind, amplitude, value, other):
    """A degree passes for no metre, and a metre for no degree: in a scene, and in a motion as a dict beside an arm."""
    assert moved(amplitude, kind).motion.joints[0].amplitude == pytest.approx(value)
    expected = "a number in rad or m, or an angle such as 0.5 deg where all joints turn, or a length such as 2 mm"
    with pytest.raises(fl.errors.SceneError, match=rf"amplitude: got '20 .*expected {expected} where all slide"):
        moved(other, kind)
    arm = fl.build_manipulator(moved(0.0, kind))
    lin = fl.linearize(arm, swinging({"amplitude": amplitude}))
    assert np.abs(lin.motion.sample(np.linspace(0.0, 1.0, 65))[0]).max() == pytest.approx(value, rel=1e-12)
    with pytest.raises(fl.errors.SceneError, match="expected a number"):
        fl.linearize(arm, swinging({"amplitude": other}))


def test_of_joints_that_slide_and_turn_a_unit_decides_nothing():
    """A fixed link on a slide counted as a joint that turns, so that the slide's motion could not be given in mm."""
    assert moved("20 mm", "prismatic", "fixed").motion.joints[0].amplitude == pytest.approx(0.02)
    with pytest.raises(fl.errors.SceneError, match="amplitude: got '20 deg'"):
        moved("20 deg", "prismatic", "revolute")


SCENE = """
schema = 1
title = "a strip"
[[links]]
length = 1.0
mass_per_length = {number}
[motion]
kind = "table"
file = "cycle.csv"
"""


CYCLE, WHOLE = sampled_cycle(), SCENE.format(number=0.2)
DOORS = {
    "toml": ("check {}/scene.toml", {"scene.toml": SCENE, "cycle.csv": CYCLE}),
    "table": ("check {}/scene.toml", {"scene.toml": WHOLE, "cycle.csv": CYCLE.replace("0.0,0.0", "0.0,{number}", 1)}),
    "first row, which is no line of names where it holds a number": (
        "check {}/scene.toml",
        {"scene.toml": WHOLE, "cycle.csv": CYCLE.replace("t,q1\n0.0,0.0", "0.0,{number}", 1)},
    ),
    "robot": ("import {}/robot.urdf --out {}/robot.toml", {"robot.urdf": ROBOT.replace("{mass}", "{number}")}),
    "set": ("check single-link --set effects.payload.mass={number}", {}),
    "a table on one line": ("check single-link --set effects.payload={mass={number}}", {}),
    "quantity": ("respond single-link --push tip_{number}_N_20_ms --out {}/out", {}),
    "range": ("chart single-link --over motion.frequency=0.5:{number} --out {}/out", {}),
}
"""A command, with _ for a space within a word and {} for its folder, and the files there."""


def knock(door: str, number: str, folder: Path) -> int:
    """The command's exit code."""
    words, files = DOORS[door]
    for name, text in files.items():
        (folder / name).write_text(text.replace("{number}", number))
    told = [word.replace("_", " ") if "tip_" in word else word for word in words.split()]
    return main([word.replace("{}", str(folder)).replace("{number}", number) for word in told])


NUMBERS = {
    "digits": "9" * 5000,
    "decimals": "0." + "1" * 5000,
    "exponent": "1e999",
    "an endless exponent": "1e" + "9" * 500,
    "beyond an arm's": "1e31",
    "below": "-1e31",
    "no number": "nan",
    "infinite": "inf",
}


@pytest.mark.parametrize("number", NUMBERS.values(), ids=NUMBERS)
@pytest.mark.parametrize("door", DOORS)
def test_no_door_lets_it_in(door, number, tmp_path, capsys):
    with pytest.raises(SystemExit) as end:  # from the reader of the command line, or as the program ends
        sys.exit(knock(door, number, tmp_path))
    said = capsys.readouterr().err
    assert end.value.code == 2
    assert len(said) < 2000
    assert "fault" not in said


@pytest.mark.parametrize("door", list(DOORS)[:6])
def test_what_an_arm_can_have_is_let_in(door, tmp_path):
    assert knock(door, "0.0" if door in list(DOORS)[1:3] else "0.25", tmp_path) == 0


def test_read_number_reads_to_its_bounds():
    read = [read_number(text) for text in (" 1e30", "-1E30 ", ".5", "0" * (LONGEST_NUMBER - 1) + "7")]
    assert read == [LARGEST_NUMBER, -LARGEST_NUMBER, 0.5, 7.0]
