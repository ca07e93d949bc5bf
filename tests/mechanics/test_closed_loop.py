"""The 5-bar scene: closed along its motion, its forces, designs and limits; its equations by multipliers: `test_loops`."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.control import physical_weights
from flexlin.errors import FlexlinError, ModelError, ToleranceNotReached
from flexlin.mechanics import close_loop

from .scenes import arm_of

U = np.array([2.3, 1.05, 2e-3, -1e-3])
U_DOT = np.array([1.5, -2.0, 0.05, 0.1])


@pytest.fixture(scope="module")
def scene():
    return fl.load_scene("five-bar")


@pytest.fixture(scope="module")
def arm(scene):
    return fl.build_manipulator(scene)


def test_loop_stays_closed_along_the_motion(arm, scene):
    """The left arm's way ends in the last link's tip, where the right one's does: the two tips are one."""
    lin = fl.linearize(arm, scene.motion)
    for q in lin.motion.sample(np.linspace(0, lin.period, 25))[0]:
        points = np.array(arm.functions["points"]([*q, 0, 0], []))
        assert np.abs(points[:, 2] - points[:, -1]).max() < 1e-12


@pytest.mark.slow
def test_floquet_and_lqr_as_for_any_arm(arm, scene):
    lin = fl.linearize(arm, scene.motion)
    design = scene.designs[0]
    gain = fl.periodic_lqr(lin.periodic_system(), *physical_weights(lin, design.weights), tol=1e-6)
    closed = fl.floquet(gain.closed_loop, tol=1e-6)
    assert fl.floquet(lin.periodic_system(), tol=1e-6).exponents.real.max() > -1e-3
    assert closed.verdict == "stable"
    assert closed.exponents.real.max() < -1


def test_stiff_links_tend_to_rigid_ones(scene):
    """Statically, elastic coordinates follow w = K_ww^-1 h_w: the deflection falls like 1/EI."""
    deflections = []
    for stiffness in (3e2, 3e3, 3e4):
        changes = {f"links.{link}.bending_stiffness": stiffness for link in (1, 3)}
        stiff = fl.load_scene("five-bar", changes)
        c = fl.linearize(fl.build_manipulator(stiff), stiff.motion).sample(np.array([0.1]))
        deflections.append(np.abs(np.linalg.solve(c.K[0][2:, 2:], c.h[0][2:])).max())
    assert np.log10(np.divide(deflections[:-1], deflections[1:])) == pytest.approx([1, 1], abs=0.02)


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
