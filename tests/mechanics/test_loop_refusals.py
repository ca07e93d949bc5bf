"""Loops that cannot be: places where they jam, with their time, and tables that do not fit."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import flexlin as fl
from flexlin.errors import ModelError, SceneError, SingularClosure
from tests.mechanics.loop_scenes import random_rssr


def test_a_dead_point_is_refused_with_its_time():
    """The crank leaves the range in which the rocker follows: the time is a root of the input-output equation."""
    table, bars, length, angle, _ = random_rssr(np.random.default_rng(1))
    table["motion"]["joints"] = [{"mean": angle, "amplitude": 3.1}]

    def room(crank):
        a = bars.ends(np.array([crank, 0.0]))[0]
        d, r = bars.bases[1] - a, bars.lengths[1]
        flat = d - (d @ bars.axes[1]) * bars.axes[1]
        return (2 * r) ** 2 * flat @ flat - (length**2 - d @ d - r**2) ** 2

    def swing(t):
        return angle + 3.1 * np.sin(2 * np.pi * t)

    t = np.linspace(0, 0.25, 400)
    first = next((a, b) for a, b in pairwise(t) if room(swing(b)) < 0)
    dead = brentq(lambda t: room(swing(t)), *first)
    scene = fl.parse_scene(table)
    with pytest.raises(SingularClosure, match=rf"dead point.*t = {dead:.5f}"):
        fl.linearize(fl.build_manipulator(scene), scene.motion)


@pytest.mark.slow
def test_a_singular_closure_is_refused_with_its_time():
    """A parallelogram goes flat when its crank lies along the base, here at t = 0.125 s: it closes there, and might turn over."""
    links = [
        {"length": 0.2, "posture": 1.0},
        {"length": 0.5, "passive": True, "posture": -1.0, "name": "coupler"},
        {
            "length": 0.2,
            "parent": "base",
            "mount": {"xyz": [0.5, 0.0, 0.0]},
            "passive": True,
            "posture": 1.0,
            "name": "rocker",
        },
    ]
    links = [{**link, "mass_per_length": 1.0} for link in links]
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": [{"mean": 1.0, "amplitude": -np.sqrt(2.0)}]}
    loops = [{"link": "coupler", "to": "rocker"}]
    table = {"schema": 1, "title": "parallelogram", "links": links, "loops": loops, "motion": motion}
    scene = fl.parse_scene(table)
    with pytest.raises(SingularClosure, match=r"at t = 0\.125 s"):
        fl.linearize(fl.build_manipulator(scene), scene.motion)
    table["motion"]["joints"] = [{"mean": 1.0, "amplitude": 0.8}]
    scene = fl.parse_scene(table)
    fl.linearize(fl.build_manipulator(scene), scene.motion)


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"loops": [{"link": "coupler", "to": "nobody"}]}, "loops.0.to", "one of crank"),
        ({"loops": [{"link": "coupler", "to": "coupler"}]}, "loops.0.to", "another link"),
        ({"loops": []}, "links.1.passive", "loops"),
        ({"links.3.parent": "tail"}, "links.3.parent", "name of a link"),
        ({"links.1.parent": "rocker"}, "links.1.parent", "before this one"),
        ({"links.3.name": "coupler"}, "loops.0.link", "only one link"),
        ({"links.1.joint": "fixed"}, "links.1.passive", "a joint that moves"),
        ({"motion.joints": [{"amplitude": 0.1}] * 4}, "motion.joints", "not passive"),
    ],
)
def test_tables_that_do_not_fit_are_named(change, key, words):
    with pytest.raises(SceneError) as error:
        fl.load_scene("spatial-four-bar", {**change, "designs": []})
    assert any(problem.key == key and words in problem.expected for problem in error.value.problems), error.value


def test_a_joint_too_many_is_counted():
    joints = [{"mean": 0.5, "amplitude": 0.8}, {"amplitude": 0.1}]
    changes = {"links.1.passive": False, "motion.joints": joints, "control": {}, "designs": []}
    with pytest.raises(ModelError, match=r"2 passive joints.*3, one for each equation"):
        fl.build_manipulator(fl.load_scene("spatial-four-bar", changes))
