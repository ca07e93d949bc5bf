"""Joint motions through a closed loop: the tip stays on its path, the rates are the angles' own derivatives."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flexlin as fl
from flexlin.errors import MotionError, ToleranceNotReached
from flexlin.mechanics.closure import five_bar
from flexlin.motion import build_motion
from flexlin.motion.closed_loop import through_loop
from flexlin.scene import parse_scene

LOOP = five_bar(0.15, (0.2, 0.3), (0.2, 0.3))
S0 = LOOP.close([2.2, -1.3, 0.95, 1.3, 0.075, 0.39], (4, 5))


def tip_circle(radius):
    joints = [{"mean": 0.075, "amplitude": radius}, {"mean": 0.39, "amplitude": radius, "phase": np.pi / 2}]
    motion = {"kind": "harmonic", "frequency": 1.0, "joints": joints}
    links = [{"length": 1.0, "mass_per_length": 1.0}] * 2
    return build_motion(parse_scene({"schema": 1, "title": "path", "links": links, "motion": motion}).motion, 2)


@pytest.fixture(scope="module")
def motion():
    return through_loop(LOOP.taylor(S0, (4, 5), 4), tip_circle(0.04), (0, 2))


def test_rates_are_derivatives(motion):
    t, h = np.linspace(0.1, 0.9, 7), 1e-4
    _, q1, q2 = motion.sample(t)
    ahead, behind = motion.sample(t + h), motion.sample(t - h)
    assert_allclose(q1, (ahead[0] - behind[0]) / (2 * h), atol=1e-6)
    assert_allclose(q2, (ahead[1] - behind[1]) / (2 * h), atol=1e-5)


def test_tip_of_the_scene_follows_the_circle(motion):
    """The scene's own kinematics, in the motors' angles, puts its rigid tip where the path led it."""
    arm = fl.build_manipulator(fl.load_scene("five-bar"))
    t = np.linspace(0, 1, 9)
    circle = tip_circle(0.04).sample(t)[0]
    for angles, there in zip(motion.sample(t)[0], circle, strict=True):
        points = np.array(arm.functions["points"]([*angles, 0, 0], []))
        assert_allclose(points[:, -1], there, atol=1e-12)


@pytest.mark.slow
def test_it_serves_as_basic_motion(motion):
    scene = fl.load_scene("five-bar")
    lin = fl.linearize(fl.build_manipulator(scene), motion, scene.control)
    assert fl.floquet(lin.periodic_system(), tol=1e-5).verdict == "stable"


def test_a_path_out_of_reach_is_named():
    with pytest.raises(ToleranceNotReached, match="du = "):
        through_loop(LOOP.taylor(S0, (4, 5), 4), tip_circle(0.5), (0, 2))


def test_a_path_that_does_not_fit_is_named():
    with pytest.raises(MotionError, match="does not fit"):
        through_loop(LOOP.taylor(S0, (4, 5), 2), tip_circle(0.04), (0, 7))
