"""The bridge: two routes, known answers of independent programs, and limits."""

import casadi as ca
import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import ArgumentError, InputError, MotionError
from flexlin.linearization import by_jacobian, by_kronecker
from tests.mechanics.scenes import linear, plain_scene, swinging

LINK = {"length": 0.7, "mass_per_length": 0.4, "bending_stiffness": 3.0, "modes": 2}
ALL = {
    "gravity": {},
    "payload": {"mass": 0.2, "inertia": 0.01},
    "hub": {"inertia": [0.05, 0.02], "mass": [0.0, 0.3], "radius": [0.05, 0.02]},
    "geometric_stiffening": {},
    "modal_damping": {"ratio": 0.02},
    "viscous_friction": {"coefficient": 0.1},
}


def two_links(effects=None):
    joints = [{"amplitude": 0.7, "mean": 0.3}, {"amplitude": -0.9, "mean": 0.8, "phase": 0.5}]
    return plain_scene([LINK, {**LINK, "length": 0.5}], swinging(*joints, frequency=0.8), effects=effects or {})


@pytest.mark.parametrize("effects", [{}, {"gravity": {}}, ALL], ids=["none", "gravity", "all"])
def test_both_routes_agree_on_two_links(effects):
    scene = two_links(effects)
    arm = fl.build_manipulator(scene)
    fast, paper = (fl.linearize(arm, scene.motion, route=route) for route in ("jacobian", "kronecker"))
    t = np.linspace(0.0, fast.period, 11)
    for name in ("M", "D", "K", "h", "B"):
        a, b = getattr(fast, name)(t), getattr(paper, name)(t)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(a).max())
    assert np.abs(fast.D(t)).max() > 0.1  # on two links D_L is full


def test_rigid_two_link_arm():
    """l = m = 1, centre inertias 1/12, g = 9.81: K and D as computed with CasADi, SymPy and Pinocchio, which agree to the digits given."""
    q, q1, q2 = np.array([0.3, 0.7]), np.array([1.5, -2.0]), np.array([3.0, -5.0])
    link = {"length": 1.0, "mass_per_length": 1.0}
    arm = fl.build_manipulator(plain_scene([link] * 2, swinging(*[{"amplitude": 0.0}] * 2), effects={"gravity": {}}))
    for route in (by_jacobian, by_kronecker):
        matrices = ca.Function("f", [arm.s, arm.s_dot, arm.s_ddot], list(route(arm)))
        _, D, K = (m.full() for m in matrices(q, q1, q2))
        np.testing.assert_allclose(K, [[-8.475995, -3.684682], [-4.127415, -4.233294]], atol=5e-7)
        np.testing.assert_allclose(D, [[1.288435, 0.322109], [0.966327, 0.0]], atol=5e-7)


def test_free_parameters_change_nothing_at_their_nominal_values():
    scene = two_links(ALL)
    free = ["links.0.length", "effects.payload.mass", "motion.frequency", "effects.hub.radius.1"]
    fixed, freed = linear(scene), fl.linearize(fl.build_manipulator(scene, free), scene.motion)
    t = np.linspace(0.0, fixed.period, 5)
    assert freed.period == fixed.period
    for name in ("M", "D", "K", "h"):
        one, other = getattr(freed, name)(t), getattr(fixed, name)(t)
        np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(fixed.K(t)).max())


TWO = two_links()
LED = {"kind": "rotation", "joints": [{"rate": 1.0, "drive": "prescribed"}]}


def linearize(*given, **more):
    return fl.linearize(fl.build_manipulator(TWO), *given, **more)


BAD = [
    (ArgumentError, "route", lambda: linearize(TWO.motion, route="guess")),
    (MotionError, "number of joints", lambda: linearize(fl.load_scene("single-link").motion)),
    (ArgumentError, "kp", lambda: linearize(TWO.motion, fl.load_scene("single-link").control)),
    (InputError, "nothing is left", lambda: linear(plain_scene([{"length": 1.0, "mass_per_length": 1.0}], LED))),
    (ArgumentError, "another kind", lambda: linearize("harmonic")),
    (ArgumentError, "cannot be left free", lambda: fl.build_manipulator(TWO, ["links.0.modes"])),
    (ArgumentError, "complex", lambda: fl.PeriodicSystem(1j * np.eye(2), 1.0)),
]


@pytest.mark.parametrize(("error", "words", "call"), BAD, ids=range(len(BAD)))
def test_bad_requests(error, words, call):
    with pytest.raises(error, match=words):
        call()


def test_a_stiffness_that_is_zero_for_a_stiff_joint_cannot_be_left_free():
    """The symbol would let the joint go: fits of such a number ended in overflow."""
    words = "stiffness of joint 1 is left free, but 0 there stands for a joint that is stiff"
    with pytest.raises(ArgumentError, match=words):
        fl.build_manipulator(fl.load_scene("quanser-two-link"), ["effects.joint_flexibility.stiffness.0"])
