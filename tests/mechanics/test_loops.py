"""Loops of a scene's own links: positions against closed forms, equations against multipliers, refusals with their time."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

import flexlin as fl
from flexlin.mechanics import close_loop
from flexlin.scene import revise_scene
from tests.thinned import thin

from .scenes import arm_of, linear, plain_scene, swinging, value

ENDS = {"five-bar": [2], "spatial-four-bar": [2], "delta": [2, 7, 12]}
"""Which drawn points of the tree without loops are the ends that loops hold to the last link."""


@pytest.mark.parametrize("name", thin(["five-bar", "spatial-four-bar", "delta"]))
def test_flexible_loops_obey_multipliers_on_the_open_tree(name):
    """The same links with all joints driven and no loop; the gap from their tips, a multiplier for each of its rows."""
    scene = fl.load_scene(name)
    table = scene.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True)
    arm = fl.build_manipulator(scene)
    passive = [i for i, link in enumerate(table["links"]) if link.get("passive")]
    links = [{k: v for k, v in link.items() if k not in ("passive", "posture")} for link in table["links"]]
    motion = swinging(*[{"amplitude": 0.1}] * len(links))
    tree = fl.build_manipulator(plain_scene(links, motion, effects=table["effects"]))
    rng = np.random.default_rng(3)
    u = np.concatenate([[s["mean"] for s in table["motion"]["joints"]], rng.normal(size=arm.n - arm.joints) * 2e-3])
    u_dot, torque = rng.normal(size=arm.n), rng.normal(size=arm.joints)
    tip, gaps = tree.points[:, -1], []
    for k, loop in zip(ENDS[name], table["loops"], strict=True):
        gaps.append(tree.points[:, k] - tip - ca.DM(loop.get("point", [0, 0, 0])[: tip.numel()]))
    tips = ca.vertcat(*gaps)
    J = ca.jacobian(tips, tree.s)
    bends = ca.jtimes(J @ tree.s_dot, tree.s, tree.s_dot)
    table_of = ca.Function("open", [tree.s, tree.s_dot], [tips, J, bends])
    kept = [i for i in range(tree.n) if i not in passive]
    s, s_dot = np.zeros(tree.n), np.zeros(tree.n)
    s[kept], s[passive] = u, np.array(arm.functions["followers"](u, []))[:, 0]
    gap, J, _ = (np.array(x) for x in table_of(s, s_dot))
    assert np.abs(gap).max() < 1e-13
    s_dot[kept] = u_dot
    s_dot[passive] = np.linalg.solve(J[:, passive], -J @ s_dot)
    bend, M = table_of(s, s_dot)[2].full()[:, 0], value(tree, "M", s)
    rest = value(tree, "residual", s, s_dot, np.zeros(tree.n))[:, 0]
    push = np.zeros(tree.n)
    push[kept[: arm.joints]] = torque
    saddle = np.block([[M, -J.T], [J, np.zeros((len(passive), len(passive)))]])
    judge = np.linalg.solve(saddle, np.concatenate([push - rest, -bend]))[kept]
    force = np.append(torque, np.zeros(arm.n - arm.joints)) - value(arm, "residual", u, u_dot, np.zeros(arm.n))[:, 0]
    found = np.linalg.solve(value(arm, "M", u), force)
    assert_allclose(found, judge, rtol=1e-8, atol=1e-8 * np.abs(judge).max())
    rate = ca.jtimes(arm.energy, ca.vertcat(arm.s, arm.s_dot), ca.vertcat(arm.s_dot, arm.s_ddot))
    kinetic = ca.Function("rate", [arm.s, arm.s_dot, arm.s_ddot], [rate])(u, u_dot, found)
    power = torque @ u_dot[: arm.joints] - u_dot @ value(arm, "damping", u, u_dot)[:, 0]
    assert_allclose(float(kinetic), power, atol=1e-9 * (abs(power) + np.abs(u_dot) @ np.abs(rest[kept])))


@pytest.fixture(scope="module")
def flexible():
    """The spatial four-bar with one mode in each direction."""
    faster = {"motion.frequency": 8.0, "control.feedback": {"kind": "pd", "kp": [40.0], "kd": [0.3]}}
    scene = fl.load_scene("spatial-four-bar", {"links.2.modes": {"y": 1, "z": 1}, "designs": [], **faster})
    return scene, fl.build_manipulator(scene)


def test_both_routes_agree_and_are_slopes_of_the_nonlinear_equations(flexible):
    scene, arm = flexible
    lins = [fl.linearize(arm, scene.motion, route=route) for route in ("jacobian", "kronecker")]
    t, h = np.linspace(0, lins[0].period, 5), 1e-5
    one, two = (lin.sample(t) for lin in lins)
    for name in "KD":
        first = getattr(one, name)
        assert_allclose(first, getattr(two, name), rtol=0, atol=1e-10 * np.abs(first).max())
    q, rate, more = (np.append(part[1], [0.0, 0.0]) for part in lins[0].motion.sample(t))
    for k, e in enumerate(h * np.eye(3)):
        for dq, dv, exact in ((e, 0 * e, one.K[1]), (0 * e, e, one.D[1])):
            change = value(arm, "residual", q + dq, rate + dv, more) - value(arm, "residual", q - dq, rate - dv, more)
            assert_allclose(change[:, 0] / (2 * h), exact[:, k], rtol=0, atol=1e-6 * np.abs(exact).max())


@pytest.mark.slow
def test_free_numbers_move_the_closure(flexible):
    """A length left free as a symbol is one that is built in."""
    scene, _ = flexible
    free = fl.build_manipulator(scene, ["links.3.length"])
    built = fl.build_manipulator(revise_scene(scene, {"links.3.length": 0.53}))
    state = ([0.3, 1e-3, -2e-3], [1.0, 0.1, 0.2], [2.0, 3.0, 4.0])
    found = free.functions["residual"](*state, [0.53])
    assert_allclose(found.full(), value(built, "residual", *state), rtol=1e-9)


def aim(crank, angle):
    """Of the shipped four-bar with a crank of this length: (C, D) of D cos rocker = C, with which the coupler of 0.9 m is met.

    Source: Hartenberg, Denavit, Kinematic Synthesis of Linkages (1964), chapter 12.
    """
    d = np.array([0.1, 0.9]) - crank * np.array([np.cos(angle), np.sin(angle)])
    return 0.9**2 - d @ d - 0.5**2, 2 * 0.5 * d[1]


def test_a_crank_goes_round_and_round():
    """Two turns of the shipped four-bar's crank against the input-output equation, and a verdict of that motion."""
    motion = {"kind": "rotation", "joints": [{"rate": 6.0}]}
    scene = fl.load_scene("spatial-four-bar", {"motion": motion, "links.2.modes": 0, "designs": []})
    arm = fl.build_manipulator(scene)
    for crank in np.linspace(0, 4 * np.pi, 97):
        C, D = aim(0.2, crank)
        rocker = value(arm, "followers", [crank])[-1, 0]
        assert np.cos(rocker) == pytest.approx(C / D, abs=1e-11)
        assert 0 < rocker < np.pi
    lin = fl.linearize(arm, scene.motion, scene.control)
    assert fl.floquet(lin.periodic_system(), tol=1e-6).verdict == "stable"


def test_a_dead_point_is_refused_with_its_time():
    """A longer crank leaves the range in which the rocker follows: the time is a root of the input-output equation."""

    def room(t):
        C, D = aim(0.6, 3.1 * np.sin(2 * np.pi * t))
        return D**2 - C**2

    dead = brentq(room, *next(ends for ends in pairwise(np.linspace(0, 0.25, 400)) if room(ends[1]) < 0))
    longer = {"links.0.length": 0.6, "links.2.modes": 0, "motion": swinging({"amplitude": 3.1}), "designs": []}
    with pytest.raises(fl.errors.SingularClosure, match=rf"dead point.*t = {dead:.5f}"):
        linear(fl.load_scene("spatial-four-bar", longer))


@pytest.mark.slow
def test_a_singular_closure_is_refused_with_its_time():
    """A parallelogram goes flat when its crank lies along the base, here at t = 0.125 s: it closes there, and might turn over."""
    bar, passive = {"length": 0.2, "posture": 1.0, "mass_per_length": 1.0}, {"passive": True}
    coupler = {**bar, **passive, "length": 0.5, "posture": -1.0, "name": "coupler"}
    rocker = {**bar, **passive, "parent": "base", "mount": {"xyz": [0.5, 0.0, 0.0]}, "name": "rocker"}

    def linearized(amplitude):
        motion = swinging({"mean": 1.0, "amplitude": amplitude})
        return linear(plain_scene([bar, coupler, rocker], motion, loops=[{"link": "coupler", "to": "rocker"}]))

    with pytest.raises(fl.errors.SingularClosure, match=r"at t = 0\.125 s"):
        linearized(-np.sqrt(2.0))
    assert linearized(0.8).n == 1


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"loops": [{"link": "coupler", "to": "nobody"}]}, "loops.0.to", "one of crank"),
        ({"loops": [{"link": "coupler", "to": "coupler"}]}, "loops.0.to", "another link"),
        ({"loops": []}, "links.1.passive", "loops"),
        ({"links.3.parent": "tail"}, "links.3.parent", "name of a link"),
        ({"links.1.parent": "rocker"}, "links.1.parent", "before this one"),
        ({"links.3.name": "coupler"}, "loops.0.link", "only one link"),
        ({"links.1.joint": "fixed"}, "links.1.passive", "a joint that moves"),
        ({"motion.joints": [{"amplitude": 0.1}] * 4}, "motion.joints", "not passive"),
    ],
)
def test_tables_that_do_not_fit_are_named(change, key, words):
    with pytest.raises(fl.errors.SceneError) as error:
        fl.load_scene("spatial-four-bar", {**change, "designs": []})
    assert any(problem.key == key and words in problem.expected for problem in error.value.problems), error.value


def test_a_joint_too_many_is_counted():
    joints = [{"mean": 0.5, "amplitude": 0.8}, {"amplitude": 0.1}]
    changes = {"links.1.passive": False, "motion.joints": joints, "control": {}, "designs": []}
    with pytest.raises(fl.errors.ModelError, match=r"2 passive joints.*3, one for each equation"):
        fl.build_manipulator(fl.load_scene("spatial-four-bar", changes))


def test_an_impossible_posture_is_refused():
    pair = arm_of(*[{"modes": 0}] * 4)
    gap, posture = pair.points[:, 2] - pair.points[:, -1], [2.2, -1.3, 0.95, 1.3]
    with pytest.raises(fl.errors.ToleranceNotReached, match="no solution"):
        close_loop(pair, gap + 100.0, [0, 2], (0, 2), posture)
    with pytest.raises(fl.errors.ModelError, match="the motors' among them"):
        close_loop(pair, gap, [3, 0], (0, 2), posture)
