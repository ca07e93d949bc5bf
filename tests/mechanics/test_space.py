"""Chains in space: unchanged when the whole scene is turned and moved, and the published numbers of the Puma."""

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

import flexlin as fl

from .scenes import random_state, value
from .spatial import random_chain, scene_table

LINK = {"length": 0.6, "mass_per_length": 0.5, "bending_stiffness": 9.0, "modes": 2}
EFFECTS = {"payload": {"mass": 0.2, "inertia": 0.01}, "geometric_stiffening": {}, "modal_damping": {"ratio": 0.01}}


def test_turning_and_moving_a_whole_scene_changes_nothing():
    """Gravity with it: the same exponents, gains and all. A planar arm is then one in space."""
    control = {"feedback": {"kind": "pd", "kp": [30.0, 10.0], "kd": [3.0, 1.0]}}
    link = {**LINK, "modes": 1, "joint": "revolute"}
    raw = scene_table([link, {**link, "mount_angle": 0.4}], **EFFECTS)
    raw |= {"control": control, "motion": {"kind": "harmonic", "frequency": 1.0, "joints": [{"amplitude": 0.5}] * 2}}
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7])

    def exponents(links, direction):
        table = {**raw, "links": links, "effects": raw["effects"] | {"gravity": {"direction": list(direction)}}}
        scene = fl.parse_scene(table)
        lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
        return fl.floquet(lin.periodic_system(), 1e-10).exponents

    base = {"xyz": [0.4, 2.0, -0.7], "rpy": turn.as_euler("xyz").tolist()}
    plain = exponents(raw["links"], [0.0, -1.0, 0.0])
    turned = exponents([{**raw["links"][0], "mount": base}, raw["links"][1]], turn.apply([0.0, -1.0, 0.0]))
    distance = np.abs(plain[:, None] - turned).min(axis=1)
    assert distance.max() <= 1e-9 * np.abs(plain).max()


def test_the_axis_may_stay_a_symbol():
    """Its derivative is that of the forces by finite differences of the axis."""
    scene = fl.parse_scene(scene_table(random_chain(np.random.default_rng(2), 2, fixed=0.0)))
    arm = fl.build_manipulator(scene, ["links.1.axis.0"])
    p, state, residual = arm.parameters, random_state(arm, 1), arm.functions["residual"]
    slope = ca.Function("f", [arm.s, arm.s_dot, arm.s_ddot, p.symbols], [ca.jacobian(arm.residual, p.symbols)])
    change = (residual(*state, p.values + 1e-6) - residual(*state, p.values - 1e-6)).full() / 2e-6
    np.testing.assert_allclose(slope(*state, p.values).full(), change, rtol=1e-6)


def test_the_puma_is_the_published_one():
    """Inertia at the motors and gravity at the nominal pose of Corke's robotics toolbox (Robotics, Vision and Control, section 9.2)."""
    inertias = np.array(fl.load_scene("puma-560").effects.joint_flexibility.motor_inertia)
    bare = {"effects.payload": "off", "effects.joint_flexibility": "off"}
    arm = fl.build_manipulator(fl.load_scene("puma-560", bare))
    q = np.array([0, np.pi / 4, np.pi, 0, np.pi / 4, 0])
    M = value(arm, "M", q) + np.diag(inertias)
    np.testing.assert_allclose(M[0], [3.6594, -0.4044, 0.1006, -0.0025, 0, 0], atol=6e-5)
    np.testing.assert_allclose(np.diag(M), [3.6594, 4.4137, 0.9378, 0.1925, 0.1713, 0.1941], atol=1.1e-4)
    np.testing.assert_allclose(value(arm, "g", q)[:, 0], [0, 31.6399, 6.0351, 0, 0.0283, 0], atol=6e-5)
