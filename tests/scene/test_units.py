"""Quantities with units: read right, or refused with what was expected."""

import functools
import math

import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import dimension_of, in_si

SAME = [
    ("2 mm", "m", 2e-3),
    ("-1.5e1cm", "m", -0.15),
    ("0.5 deg", "rad", math.pi / 360),
    ("30 rpm", "rad/s", math.pi),
    ("90 deg/s", "rad/s", math.pi / 2),
    ("3 N m", "N m", 3.0),
    ("3 Nm", "N m", 3.0),
    ("250 mN m", "N m", 0.25),
    ("3 N*m", "N m", 3.0),
    ("1 J", "N m", 1.0),
    ("20 ms", "s", 0.02),
    ("80 mm/s", "m/s", 0.08),
    ("0.3", "m", 0.3),
    (0.3, "m", 0.3),
    (2, "rad/s", 2.0),
    ("12 V A", "W", 12.0),
    ("1 kg m^2/s^2", "N m", 1.0),
]


@pytest.mark.parametrize(("text", "unit", "value"), SAME)
def test_quantities_in_si(text, unit, value):
    assert in_si(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["2 deg", "2 s", "2 m/s", "2 m m", "m", "", "2 mn", "nan m", "inf", "1e999x m", True, None, [1.0], "2 m/"]
)
def test_what_is_no_length_is_refused(text):
    with pytest.raises(ValueError, match="a length such as 2 mm"):
        in_si(text, "m")


@pytest.mark.parametrize("unit", ["ohm", "B", "N m/(rad s)", "N/(m s)"])
def test_the_unit_that_a_key_states_can_be_written(unit):
    """The JSON schema allowed texts for these keys, and none could be read."""
    same = {"ohm": "V/A", "B": "MB", "N m/(rad s)": "N m/rad/s", "N/(m s)": "N/m/s"}
    assert dimension_of(unit)[0] == 1.0
    assert dimension_of(unit)[1] == dimension_of(same[unit])[1]


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
    "effects.payload.mass": ("30 g", 0.03),
    "effects.hub.inertia": ("5859.8 g cm^2", 5.8598e-4),
    "effects.gravity.acceleration": ("981 cm/s^2", 9.81),
    "motion.frequency": ("500 mHz", 0.5),
    "accuracy.memory": ("500 MB", 5e8),  # refused, though the JSON schema allowed such a text
    "motion.joints.0.amplitude": ("30 deg", math.pi / 6),
    "control.feedback.kp": (["3000 mN m/rad"], (3.0,)),
    "accuracy.seconds": ("1 min", 60.0),
}
"""Of conversions by hand."""


@pytest.mark.parametrize("path", WRITTEN)
def test_a_number_of_a_scene_may_carry_its_unit(path):
    text, value = WRITTEN[path]
    scene = fl.load_scene("single-link", {path: text})
    found = functools.reduce(
        lambda at, key: at[int(key)] if key.isdigit() else getattr(at, key), path.split("."), scene
    )
    assert found == pytest.approx(value, rel=1e-12)


def test_of_joints_that_slide_and_turn_a_unit_decides_nothing():
    """A degree passes for no metre, and a metre for no degree."""

    def scene_of(*kinds, amplitude):
        links = [{"length": 0.3, "mass_per_length": 1.0, "modes": 0, "joint": kind} for kind in kinds]
        motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": amplitude}] * len(kinds)}
        return fl.parse_scene({"schema": 1, "title": "joints", "links": links, "motion": motion})

    assert scene_of("prismatic", amplitude="20 mm").motion.joints[0].amplitude == pytest.approx(0.02)
    assert scene_of("revolute", amplitude="20 deg").motion.joints[0].amplitude == pytest.approx(math.pi / 9)
    for kinds, amplitude in ((["prismatic"], "20 deg"), (["revolute"], "20 mm"), (["prismatic", "revolute"], "20 deg")):
        expected = "expected a number in rad or m, or an angle such as 0.5 deg where all joints turn, or a length"
        with pytest.raises(
            fl.errors.SceneError, match=rf"amplitude: got '20 .*{expected} such as 2 mm where all slide"
        ):
            scene_of(*kinds, amplitude=amplitude)


def test_a_fixed_link_does_not_turn():
    """A fixed link on a slide counted as a joint that turns, so that the slide's motion could not be given in mm."""
    links = [{"length": 0.3, "mass_per_length": 1.0, "modes": 0, "joint": kind} for kind in ("prismatic", "fixed")]
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": "20 mm"}]}
    scene = fl.parse_scene({"schema": 1, "title": "mast on a slide", "links": links, "motion": motion})
    assert scene.motion.joints[0].amplitude == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("kind", "amplitude", "value"), [("prismatic", "20 mm", 0.02), ("revolute", "20 deg", math.pi / 9)]
)
def test_a_motion_as_a_dict_has_the_units_of_the_arms_joints(kind, amplitude, value):
    link = {"length": 0.3, "mass_per_length": 1.0, "modes": 0, "joint": kind}
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.0}]}
    arm = fl.build_manipulator(fl.parse_scene({"schema": 1, "title": "joint", "links": [link], "motion": motion}))
    lin = fl.linearize(arm, {**motion, "joints": [{"amplitude": amplitude}]})
    q = lin.motion.sample(np.linspace(0.0, 1.0, 65))[0]
    assert np.abs(q).max() == pytest.approx(value, rel=1e-12)
    other = {"prismatic": "20 deg", "revolute": "20 mm"}[kind]
    with pytest.raises(fl.errors.SceneError, match="expected a number"):
        fl.linearize(arm, {**motion, "joints": [{"amplitude": other}]})
