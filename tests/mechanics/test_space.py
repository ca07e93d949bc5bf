"""Rigid chains in space: against Newton and Euler by finite rotations, and unchanged when the whole scene is turned and moved."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexlin as fl

from .scenes import value


def test_the_puma_is_the_published_one():
    """Inertia at the motors and gravity at the nominal pose of Corke's robotics toolbox (Robotics, Vision and Control, section 9.2)."""
    inertias = np.array(fl.load_scene("puma-560").effects.joint_flexibility.motor_inertia)
    arm = fl.build_manipulator(
        fl.load_scene("puma-560", {"effects.payload": "off", "effects.joint_flexibility": "off"})
    )
    q = np.array([0, np.pi / 4, np.pi, 0, np.pi / 4, 0])
    M = value(arm, "M", q) + np.diag(inertias)
    np.testing.assert_allclose(M[0], [3.6594, -0.4044, 0.1006, -0.0025, 0, 0], atol=6e-5)
    np.testing.assert_allclose(np.diag(M), [3.6594, 4.4137, 0.9378, 0.1925, 0.1713, 0.1941], atol=1.1e-4)
    np.testing.assert_allclose(value(arm, "g", q)[:, 0], [0, 31.6399, 6.0351, 0, 0.0283, 0], atol=6e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["manutec-r3", "puma-560", "spatial-arm"])
def test_arms_that_travel_with_flexlin_hold_their_motion(name):
    """The loop that the scene states is stable, and no exponent changes when the arm is turned about the vertical."""
    scene = fl.load_scene(name)
    found = [
        fl.floquet(fl.linearize(fl.build_manipulator(each), each.motion, each.control).periodic_system())
        for each in (scene, scene.model_copy(update={"links": (turned(scene.links[0]), *scene.links[1:])}))
    ]
    assert found[0].verdict == "stable"
    first, second = (result.exponents for result in found)
    distance = np.abs(first[:, None] - second).min(axis=1).max()
    assert distance <= 1e-9 * np.abs(first).max()


def turned(link):
    """A link whose joint is mounted elsewhere on the ground, turned by 0.7 rad about the world's z."""
    xyz = np.add(link.mount.xyz, [0.3, -0.2, 0.5])
    rotation = Rotation.from_rotvec([0, 0, 0.7]) * Rotation.from_euler("xyz", link.mount.rpy)
    mount = link.mount.model_copy(update={"xyz": tuple(xyz), "rpy": tuple(rotation.as_euler("xyz"))})
    return link.model_copy(update={"mount": mount})
