"""A scene that asks for the feedforward of the elastic motion: simulated, reported and held against the drives with it."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.answers import analyse
from flexlin.report import advise, record, to_json

SCENE = {"links.0.modes": 1, "control.feedforward": "tip-exact", "accuracy.tol": 1e-6, "designs": [], "drives": {}}


@pytest.mark.slow
def test_the_report_follows_the_elastic_motion():
    scene = fl.load_scene("single-link", SCENE)
    found, plain = analyse(scene), analyse(fl.load_scene("single-link", {**SCENE, "control.feedforward": "rigid"}))
    closed = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    forward = fl.control.feedforward(closed, "tip-exact", tol=1e-8)
    assert found.response.tip_error.max() == pytest.approx(forward.tip_error, rel=1e-3)
    assert found.response.tip_error.max() < 0.05 * plain.response.tip_error.max()
    assert found.simulation.tip_error == pytest.approx(forward.tip_error, rel=0.05)
    np.testing.assert_allclose(found.load(found.own).torque, forward.torque(found.t[:-1]), atol=1e-9)
    assert np.array_equal(found.own.floquet.exponents, plain.own.floquet.exponents)
    assert to_json(record(found))
    assert "tip-exact feedforward" in " ".join(advise(found))


def test_simulate_takes_the_scenes_feedforward_unless_another_is_given():
    scene = fl.load_scene("single-link", SCENE)
    closed = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    own, rigid = (fl.simulate(closed, 0.5, tol=1e-6, law=law) for law in (None, closed.law))
    assert own.tip_error < 0.05 * rigid.tip_error
