"""The 5-bar scene: its designs and limits; its equations by multipliers: `test_loops`."""

import pytest

import flexlin as fl
from flexlin.control import physical_weights
from flexlin.errors import FlexlinError, ModelError, ToleranceNotReached
from flexlin.mechanics import close_loop

from .scenes import arm_of


@pytest.fixture(scope="module")
def scene():
    return fl.load_scene("five-bar")


@pytest.fixture(scope="module")
def arm(scene):
    return fl.build_manipulator(scene)


@pytest.mark.slow
def test_floquet_and_lqr_as_for_any_arm(arm, scene):
    lin = fl.linearize(arm, scene.motion)
    design = scene.designs[0]
    gain = fl.periodic_lqr(lin.periodic_system(), *physical_weights(lin, design.weights), tol=1e-6)
    closed = fl.floquet(gain.closed_loop, tol=1e-6)
    assert fl.floquet(lin.periodic_system(), tol=1e-6).exponents.real.max() > -1e-3
    assert closed.verdict == "stable"
    assert closed.exponents.real.max() < -1


@pytest.mark.slow
def test_a_motion_out_of_reach_is_refused(arm, scene):
    motion = scene.motion.model_copy(
        update={"joints": [j.model_copy(update={"amplitude": 3.0}) for j in scene.motion.joints]}
    )
    with pytest.raises(FlexlinError, match=r"posture.*got t = "):
        fl.linearize(arm, motion)


def test_an_impossible_posture_is_refused():
    pair = arm_of(*[{"modes": 0}] * 4)
    gap, posture = pair.points[:, 2] - pair.points[:, -1], [2.2, -1.3, 0.95, 1.3]
    with pytest.raises(ToleranceNotReached, match="no solution"):
        close_loop(pair, gap + 100.0, [0, 2], (0, 2), posture)
    with pytest.raises(ModelError, match="the motors' among them"):
        close_loop(pair, gap, [3, 0], (0, 2), posture)
