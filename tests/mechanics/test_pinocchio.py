"""Rigid chains against Pinocchio: mass matrix, and derivatives of the inverse dynamics."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.mechanics import build_manipulator
from flexlin.scene import parse_scene

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
        arm = build_manipulator(scene)
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
