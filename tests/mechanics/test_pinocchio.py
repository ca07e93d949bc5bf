"""Rigid chains, and robots from outside, against Pinocchio: the same equations and their derivatives along a motion."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import read_robot, scene_tables
from tests.scene.test_urdf import ROBOTS, put, xml_of

from .scenes import value
from .spatial import random_chain

pin = pytest.importorskip("pinocchio", reason="flexlin[peers]")
pytestmark = pytest.mark.peers


class Outside:
    """A chain of a file by Pinocchio: other joints stand still and carry nothing; dampers as the XML states them."""

    def __init__(self, path, names):
        self.model = pin.buildModelFromUrdf(str(path))
        self.data, self.ids = self.model.createData(), [self.model.getJointId(name) for name in names]
        for j in set(range(1, self.model.njoints)) - set(self.ids):
            self.model.inertias[j] = pin.Inertia.Zero()
        joints = {joint.get("name"): joint for joint in ET.parse(path).getroot().findall("joint")}
        dampers = [joints[name].find("dynamics") for name in names]
        self.damping = np.diag([0.0 if found is None else float(found.get("damping", 0)) for found in dampers])
        self.at = [self.model.joints[j].idx_v for j in self.ids]

    def widen(self, x, v, a):
        """The state of the whole robot; a continuous joint is a point of the circle there."""
        q, rates = pin.neutral(self.model), np.zeros((2, self.model.nv))
        rates[:, self.at] = v, a
        for j, angle in zip(self.ids, x, strict=True):
            i, circle = self.model.joints[j].idx_q, self.model.joints[j].nq == 2
            q[i : i + 1 + circle] = [np.cos(angle), np.sin(angle)] if circle else angle
        return q, *rates

    def equations(self, *state):
        """Forces of the inverse dynamics, K, D, M of the chain, and the place of each frame."""
        q, v, a = self.widen(*state)
        forces = pin.rnea(self.model, self.data, q, v, a)[self.at] + self.damping @ v[self.at]
        K, D, M = (
            np.array(part)[np.ix_(self.at, self.at)]
            for part in pin.computeRNEADerivatives(self.model, self.data, q, v, a)
        )
        pin.framesForwardKinematics(self.model, self.data, q)
        return forces, K, D + self.damping, np.triu(M) + np.triu(M, 1).T


def compare(path, tip, rng):
    """Forces, weight, K, D, M and the tip's place, at three times of a random motion."""
    raw = scene_tables(read_robot(path), tip=tip)
    raw["effects"].pop("coulomb_friction", None)
    swings = rng.uniform(-2, 2, (len(raw["motion"]["joints"]), 2)).tolist()
    joints = [{"mean": mean, "amplitude": 0.7, "phase": phase} for mean, phase in swings]
    scene = fl.parse_scene({**raw, "motion": {"kind": "harmonic", "frequency": 0.7, "joints": joints}})
    arm = fl.build_manipulator(scene)
    lin = fl.linearize(arm, scene.motion)
    outside = Outside(path, [link.name for link in scene.links if link.joint != "fixed"])
    for t in (0.0, 0.31, 1.1):
        q, rate, acceleration = (part[0] for part in lin.motion.sample(np.array([t])))
        forces, K, D, M = outside.equations(q, rate, acceleration)
        still = outside.equations(q, 0 * rate, 0 * rate)[0]
        place = outside.data.oMf[outside.model.getFrameId(tip)].translation
        pairs = [
            (value(arm, "residual", q, rate, acceleration)[:, 0], forces),
            (value(arm, "g", q)[:, 0], still),
            (lin.K(t), K),
            (lin.D(t), D),
            (lin.M(t), M),
            (value(arm, "points", q)[:, -1], place),
        ]
        for got, want in pairs:
            np.testing.assert_allclose(got, want, rtol=0, atol=1e-10 * np.abs(want).max() + 1e-13)


CHAINS = [
    ("panda", "panda_hand_tcp"),
    ("panda", "panda_rightfinger"),
    ("baxter", "left_hand_camera_link"),
    ("baxter", "r_gripper_r_finger_tip"),
    ("baxter", "display"),
    ("alexander", "LEFT_FOOT_IMU_LINK"),
]


@pytest.mark.parametrize(("name", "tip"), CHAINS)
def test_robots_from_outside(name, tip):
    compare(ROBOTS / f"{name}.urdf", tip, np.random.default_rng(len(tip)))


@pytest.mark.parametrize("joints", range(1, 8))
def test_random_chains(joints, tmp_path):
    """56 of them, with any axes and mounts."""
    for seed in range(8):
        rng = np.random.default_rng(1000 * joints + seed)
        links = random_chain(rng, joints)
        limited = xml_of(links).replace("<axis", '<limit lower="-99" upper="99" effort="99" velocity="99"/><axis')
        compare(put(tmp_path, limited), f"l{len(links)}", rng)
