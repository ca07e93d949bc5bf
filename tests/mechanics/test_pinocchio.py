"""Rigid chains, and robots from outside, against Pinocchio: the same equations and their derivatives along a motion."""

import xml.etree.ElementTree as ET
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import parse_scene, read_robot, scene_tables

from .scenes import random_state, value
from .spatial import GRAVITY, mount_of, random_chain, scene_table

pin = pytest.importorskip("pinocchio", reason="flexlin[peers]")
pytestmark = pytest.mark.peers


def spatial_model(links):
    """The same links from Pinocchio's own parts; bodies on fixed joints go to the joint before them."""
    model, parent, place = pin.Model(), 0, pin.SE3.Identity()
    model.gravity.linear = GRAVITY
    kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
    for i, link in enumerate(links):
        rotation, xyz = mount_of(link)
        place = place * pin.SE3(rotation, xyz)
        if link["joint"] != "fixed":
            axis = np.array(link["axis"]) / np.linalg.norm(link["axis"])
            parent = model.addJoint(parent, kinds[link["joint"]](axis), place, f"joint{i}")
            place = pin.SE3.Identity()
        body = link["body"]
        J = np.array([[body["inertia"]["".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
        model.appendBodyToJoint(parent, pin.Inertia(body["mass"], np.array(body["centre"]), J), place)
    return model


@pytest.mark.parametrize("joints", range(1, 8))
def test_spatial_chains(joints):
    """M, forces and gravity of 56 random chains with any axes and mounts, and K and D along a motion, to 1e-10."""
    for seed in range(8):
        links = random_chain(np.random.default_rng(1000 * joints + seed), joints)
        scene = parse_scene(scene_table(links))
        arm = fl.build_manipulator(scene)
        model = spatial_model(links)
        data = model.createData()
        lin = fl.linearize(arm, scene.motion)
        q, rate, acceleration = (part[0] for part in lin.motion.sample(np.array([0.3])))
        cases = [(q, rate, acceleration, lin.K(0.3), lin.D(0.3), lin.M(0.3))]
        state = [arm.s, arm.s_dot, arm.s_ddot]
        jacobians = ca.Function("J", state, [ca.densify(ca.jacobian(arm.residual, x)) for x in state])
        random = random_state(arm, seed)
        cases.append((*random, *(np.array(part) for part in jacobians(*random))))
        for *at, K, D, M in cases:
            torque = pin.rnea(model, data, *at)
            np.testing.assert_allclose(
                value(arm, "residual", *at)[:, 0], torque, rtol=0, atol=1e-10 * abs(torque).max()
            )
            expected = pin.computeRNEADerivatives(model, data, *at)
            mass = np.triu(expected[2]) + np.triu(expected[2], 1).T
            for got, want in zip((K, D, M), (expected[0], expected[1], mass), strict=True):
                np.testing.assert_allclose(got, want, rtol=0, atol=1e-10 * np.abs(want).max() + 1e-14)


ROBOTS = Path(__file__).parents[1] / "robots"
CHAINS = [
    ("panda", "panda_hand_tcp"),
    ("panda", "panda_rightfinger"),
    ("baxter", "left_hand_camera_link"),
    ("baxter", "r_gripper_r_finger_tip"),
    ("baxter", "display"),
    ("alexander", "LEFT_FOOT_IMU_LINK"),
]


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


@pytest.mark.parametrize(("name", "tip"), CHAINS)
def test_the_same_equations_along_a_motion(name, tip):
    path = ROBOTS / f"{name}.urdf"
    raw = scene_tables(read_robot(path), tip=tip)
    raw["effects"].pop("coulomb_friction", None)
    rng, n = np.random.default_rng(len(tip)), len(raw["motion"]["joints"])
    swings = [{"mean": float(m), "amplitude": 0.7, "phase": float(p)} for m, p in rng.uniform(-2, 2, (n, 2))]
    scene = fl.parse_scene({**raw, "motion": {"kind": "harmonic", "frequency": 0.7, "joints": swings}})
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
