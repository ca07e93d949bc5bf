"""Tip paths: forward kinematics written here puts the tip on the path, rates are derivatives, and refusals name time and distance."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq, minimize
from scipy.spatial.transform import Rotation, Slerp

import flexlin as fl
from flexlin.errors import MotionError, SceneError, ToleranceNotReached
from flexlin.mechanics import five_bar
from flexlin.motion.closed_loop import through_loop
from tests.mechanics.scenes import plain_scene, swinging, value
from tests.mechanics.spatial import random_chain

BAR = {"mass_per_length": 1.0}
T = 2.0


def circle(centre, radius, **more):
    return {"kind": "circle", "centre": list(centre), "radius": radius, "period": T, **more}


def lead(source, path, joints=None, changes=None, **more):
    """The motion of an arm, a built-in scene or links, and the arm."""
    motion = {"kind": "tip-path", "path": path, **more, **({} if joints is None else {"joints": joints})}
    if isinstance(source, str):
        scene = fl.load_scene(source, {"motion": motion, "designs": [], **(changes or {})})
    else:
        scene = plain_scene(source, motion)
    arm = fl.build_manipulator(scene)
    return fl.build_motion(scene.motion, arm.joints, arm=arm), arm, scene


def bars(*lengths):
    return [{**BAR, "length": length} for length in lengths]


def postures(*angles):
    return [{"posture": float(angle)} for angle in angles]


def plane_tip(q, lengths):
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles) @ lengths, np.sin(angles) @ lengths], axis=-1)


def around(t, centre, radius):
    """The place of a circle in the plane at given times."""
    return np.add(centre, radius * np.stack([np.cos(np.pi * t), np.sin(np.pi * t)], axis=-1))


def spectral_rates(motion, count=128):
    """q' and q'' of a smooth motion from its values at equal steps."""
    t = motion.period * np.arange(count) / count
    waves = np.fft.fft(motion.sample(t)[0], axis=0)
    k = 2j * np.pi * np.fft.fftfreq(count, motion.period / count)[:, None]
    return t, *(np.fft.ifft(k**order * waves, axis=0).real for order in (1, 2))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_arms_follow_random_circles(seed):
    """Joints that are just enough, and more than that, with and without orientation; the path begins where some posture has the tip."""
    rng = np.random.default_rng(seed)
    joints = int(rng.integers(4, 8))  # the last one only turns the tip
    links = [link | {"joint": "revolute"} for link in random_chain(rng, joints, fixed=0.0)]
    arm = fl.build_manipulator(plain_scene(links, swinging(*[{"amplitude": 0.0}] * joints)))
    q0 = rng.uniform(-2, 2, joints)
    R, p = value(arm, "rotation", q0), value(arm, "points", q0)[:, -1]
    turned = bool(joints >= 6 and rng.random() < 0.7)
    more = {"rpy": Rotation.from_matrix(R).as_euler("xyz").tolist()} if turned else {}
    normal = rng.normal(size=3)
    path = circle(p, 0.02, normal=normal.tolist(), **more)
    motion, _, _ = lead(links, path, postures(*q0 + rng.normal(size=joints) * 0.05))
    t, rate, second = spectral_rates(motion)
    q, q1, q2 = motion.sample(t)
    away = np.array([value(arm, "points", row)[:, -1] for row in q]) - p
    assert_allclose(np.linalg.norm(away, axis=1), 0.02, rtol=0, atol=1e-12)
    assert_allclose(away @ normal, 0, atol=1e-12)
    if turned:
        assert_allclose([value(arm, "rotation", row) for row in q], np.broadcast_to(R, (len(t), 3, 3)), atol=1e-10)
    assert_allclose(q1, rate, atol=1e-9 * max(np.abs(rate).max(), 1))
    assert_allclose(q2, second, atol=1e-8 * max(np.abs(second).max(), 1))
    assert_allclose(motion.sample(np.array([0.0, T, 7 * T]))[0], np.tile(q[0], (3, 1)), atol=1e-12)


@pytest.mark.slow
def test_redundant_joints_stay_as_near_to_their_posture_as_they_can():
    """Three joints in a plane: at each time the nearest angles of all that reach the point, found by another program."""
    lengths, posture = (0.5, 0.4, 0.3), np.array([0.3, 0.8, 0.4])
    motion, _, _ = lead(bars(*lengths), circle((0.5, 0.5, 0.0), 0.2), postures(*posture))
    t = np.linspace(0, T, 7)
    q = motion.sample(t)[0]
    for row in q:
        there = plane_tip(row, lengths)
        near = minimize(
            lambda x: np.sum((x - posture) ** 2),
            row + 0.1,
            constraints={"type": "eq", "fun": lambda x, there=there: plane_tip(x, lengths) - there},
            options={"ftol": 1e-14, "maxiter": 300},
        )
        assert_allclose(row, near.x, atol=1e-5)
    assert_allclose(plane_tip(q, lengths)[0], [0.7, 0.5], atol=1e-13)


def test_lines_rest_at_their_waypoints_and_blends_pass_them():
    points, lengths = [[0.5, 0.3, 0.0], [0.7, 0.3, 0.0], [0.6, 0.5, 0.0]], (0.5, 0.5)
    table = {"kind": "polyline", "points": points, "move_time": 0.5}
    motion, _, _ = lead(bars(*lengths), {**table, "dwell_time": 0.1}, postures(0.0, 1.0))
    assert motion.period == pytest.approx(1.8)
    q, q1, q2 = motion.sample(np.array([0.0, 0.55, 0.6, 1.15, 1.2, 1.75]))
    assert_allclose(plane_tip(q, lengths), np.array(points)[[0, 1, 1, 2, 2, 0], :2], atol=1e-13)
    assert np.abs(q1).max() < 1e-12
    assert np.abs(q2).max() < 1e-9
    assert_allclose(plane_tip(motion.sample(np.array([0.25]))[0], lengths), [[0.6, 0.3]], atol=1e-13)
    blended, _, _ = lead(bars(*lengths), {**table, "blend_time": 0.2}, postures(0.0, 1.0))
    assert blended.period == pytest.approx(0.9)
    corner = plane_tip(blended.sample(np.array([0.4]))[0], lengths)[0]
    assert 1e-3 < np.linalg.norm(corner - points[1][:2]) < 0.05
    fine = np.linspace(0, 0.9, 20001)
    q, q1, q2 = blended.sample(fine)
    assert_allclose(np.gradient(q, fine, axis=0)[1:-1], q1[1:-1], atol=1e-5)
    assert np.abs(np.diff(q2, axis=0)).max() < 0.02 * np.ptp(q2)


def test_orientation_turns_from_waypoint_to_waypoint():
    """The six axes of the r3 between two poses: at rest there, and on the great circle between."""
    q = np.array([0.1, 0.5, 1.5, 0.3, 0.8, 0.2])
    arm = fl.build_manipulator(fl.load_scene("manutec-r3"))
    E = arm.reference.full()
    place = value(arm, "points", E @ q)[:, -1]
    turns = Rotation.from_matrix(value(arm, "rotation", E @ q))
    ends = [turns, turns * Rotation.from_rotvec([0.2, -0.3, 0.1])]
    points = [place.tolist(), np.add(place, [0.05, 0.1, -0.1]).tolist()]
    path = {"kind": "polyline", "points": points, "move_time": 1.0, "rpy": [r.as_euler("xyz").tolist() for r in ends]}
    motion, arm, _ = lead("manutec-r3", path, postures(*q))
    between = Slerp([0, 1], Rotation.concatenate(ends))
    for t, share in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (1.5, 0.5)):
        s = E @ motion.sample(np.array([t]))[0][0]
        assert_allclose(value(arm, "rotation", s), between(share).as_matrix(), atol=1e-12)
        assert_allclose(value(arm, "points", s)[:, -1], np.average(points, 0, [1 - share, share]), atol=1e-12)


@pytest.mark.slow
def test_a_delta_follows_a_circle_by_its_closed_form():
    """Each arm's angle from the triangle of arm, rod and platform: a cos q + b sin q = c."""
    motion, _, scene = lead("delta", circle((0.02, -0.01, -0.32), 0.05))
    t = np.linspace(0, T, 9)
    q, x = motion.sample(t)[0], np.insert(around(t, (0.02, -0.01), 0.05), 2, -0.32, axis=1)
    arm, rod = scene.links[0].length, scene.links[2].length
    for k, yaw in enumerate(2 * np.pi / 3 * np.arange(3)):
        out = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        d = x + (0.04 - 0.1) * out
        a, b, c = 2 * arm * d @ out, -2 * arm * d[:, 2], np.sum(d**2, axis=1) + arm**2 - rod**2
        assert_allclose(q[:, k], np.arctan2(b, a) - np.arccos(c / np.hypot(a, b)), atol=1e-12)


def test_a_five_bar_follows_a_circle_as_its_taylor_map_does():
    motion, _, _ = lead("five-bar", circle((0.075, 0.39, 0.0), 0.04), postures(2.2, 0.95))
    loop = five_bar(0.15, (0.2, 0.3), (0.2, 0.3))
    start = loop.close([2.2, -1.3, 0.95, 1.3, 0.075, 0.39], (4, 5))
    taylor, t = loop.taylor(start, (4, 5), 4), np.linspace(0, T, 9)

    def mapped(radius, joints=(0, 2)):
        phases = ((0.075, np.pi / 2), (0.39, 0.0))
        swings = [{"mean": mean, "amplitude": radius, "phase": phase} for mean, phase in phases]
        return through_loop(taylor, fl.build_motion(swinging(*swings, frequency=1 / T)), joints)

    assert_allclose(motion.sample(t), mapped(0.04).sample(t), atol=1e-11)
    with pytest.raises(ToleranceNotReached, match="du = "):
        mapped(0.5)
    with pytest.raises(MotionError, match="does not fit"):
        mapped(0.04, (0, 7))


@pytest.mark.slow
def test_it_serves_as_basic_motion_and_may_be_prescribed():
    joints = postures(0.2, 0.8, -0.9)
    path = circle((1.2, 0.3, 0.3), 0.2, normal=[1.0, 0.0, 1.0])
    _, arm, scene = lead("spatial-arm", path, joints)
    lin = fl.linearize(arm, scene.motion, scene.control)
    assert fl.floquet(lin.periodic_system(), tol=1e-6).verdict == "stable"
    held, _, _ = lead("spatial-arm", path, [{"posture": 0.2, "drive": "prescribed"}, *joints[1:]], {"control": {}})
    assert held.prescribed == (True, False, False)


def test_a_circle_round_the_base_turns_the_first_joint_once():
    motion, _, _ = lead(bars(0.5, 0.5), circle((0.0, 0.0, 0.0), 0.7), postures(-0.8, 1.6))
    t = np.linspace(0, 0.999 * T, 50)
    q, q1, _ = motion.sample(t)
    assert_allclose(q1[:, 0], 2 * np.pi / T, atol=1e-9)
    assert_allclose(plane_tip(q, (0.5, 0.5)), around(t, (0, 0), 0.7), atol=1e-12)


@pytest.mark.slow
def test_joints_that_do_not_come_back_are_said():
    """Round its base a redundant arm cannot stay near one posture: it comes back turned, or not at all."""
    with pytest.raises(MotionError, match=r"do not come back.*joint 1|singular place"):
        lead(bars(0.4, 0.3, 0.3), circle((0.0, 0.0, 0.0), 0.7), postures(-0.5, 0.7, 0.5))


@pytest.mark.slow
def test_a_path_out_of_reach_is_refused_with_its_time_and_distance():
    """|x(t)| = 1 is where the arm of length 1 ends; the farthest point lies 0.1 m beyond."""
    path = circle((0.65, 0.0, 0.0), 0.45)
    leaves = brentq(lambda t: np.linalg.norm(around(t, (0.65, 0), 0.45)) - 1.0, 0.1, 1.0)
    with pytest.raises(MotionError, match=r"out of reach from t = 0 s on, by 0\.1 m at t = \S+ s"):
        lead(bars(0.55, 0.45), path, postures(0.5, 1.0))
    turned = {**path, "normal": [0.0, 0.0, -1.0], "centre": [-0.65, 0.0, 0.0]}
    with pytest.raises(MotionError) as error:
        lead(bars(0.55, 0.45), turned, postures(2.5, 1.0))
    found = re.search(r"from t = (\S+) s on, by (\S+) m at t = (\S+) s", str(error.value))
    assert [float(x) for x in found.groups()] == pytest.approx([1 - leaves, 0.1, 1.0], abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("begin", "end", "angles", "time"), [(-0.4, 0.4, (2.5, 1.5), r"0\.5"), (0.6, 1.0, (-0.5, 1.0), r"(1|0\.99\d*)")]
)
def test_a_singular_place_is_refused_with_its_time(begin, end, angles, time):
    """Equal links fold where a line leads the tip through the base, half way, and are stretched where it ends."""
    line = {"kind": "polyline", "points": [[begin, 0.0, 0.0], [end, 0.0, 0.0]], "move_time": 1.0}
    with pytest.raises(MotionError, match=rf"singular place.* t = {time} s"):
        lead(bars(0.5, 0.5), line, postures(*angles))


@pytest.mark.slow
def test_limits_choose_the_elbow_or_refuse_with_their_time():
    def follow(first, **second):
        return lead(bars(0.5, 0.5), circle((0.5, 0.4, 0.0), 0.1), [first, second])[0]

    assert follow({"posture": 1.0}, posture=-1.0).sample(np.zeros(1))[0][0, 1] < 0
    assert follow({"posture": 1.0}, posture=-1.0, low=0.0).sample(np.linspace(0, T, 50))[0][:, 1].min() > 0
    with pytest.raises(MotionError, match=r"joint 2 above its limit.*t = .* s, from t = "):
        follow({}, posture=1.0, low=0.0, high=1.3)


HERE, ORIGIN = (0.5, 0.2, 0.0), [0.0, 0.0, 0.0]


def test_one_component_may_be_led_alone():
    motion, _, _ = lead(bars(0.5), circle((0.0, 0.0, 0.0), 0.3), postures(0.9), follow=["x"])
    t = np.linspace(0, T, 9)
    assert_allclose(0.5 * np.cos(motion.sample(t)[0][:, 0]), 0.3 * np.cos(np.pi * t), atol=1e-13)


def line(count, **more):
    return {"kind": "polyline", "points": [ORIGIN] * count, "move_time": 1.0, **more}


@pytest.mark.parametrize(
    ("links", "path", "more", "words"),
    [
        (2, circle((0.5, 0.2, 0.1), 0.1), {}, "leaves the arm's plane"),
        (2, circle(HERE, 0.1, normal=[1.0, 0.0, 0.0]), {}, "leaves the arm's plane"),
        (2, circle(HERE, 0.1, rpy=[0.0, 0.0, 1.0]), {}, "more than the joints can do"),
        (3, circle(HERE, 0.1, rpy=[0.3, 0.0, 1.0]), {}, "out of the arm's plane"),
        (1, circle(HERE, 0.1), {}, "more than the joints can do"),
        (2, circle(HERE, 0.1), {"follow": ["x", "x"]}, "twice"),
        pytest.param(2, circle((50.0, 0.2, 0.0), 0.1), {}, "leaves the arm's reach", marks=pytest.mark.slow),
        (2, circle(HERE, -0.1), {}, r"motion\.path\.radius:"),
        (2, circle(HERE, 0.1, normal=[0, 0, 0]), {}, r"motion\.path\.normal:"),
        (2, {"kind": "spiral"}, {}, r"motion\.path\.kind:"),
        (2, line(1), {}, r"motion\.path\.points:"),
        (2, line(2, blend_time=0.6), {}, r"motion\.path:"),
        (2, line(3, rpy=[ORIGIN] * 2), {}, r"motion\.path:"),
        (2, circle(HERE, 0.1), {"joints": [{"low": 1.0, "high": 0.0}, {}]}, r"motion\.joints\.0:"),
        (2, circle(HERE, 0.1), {"joints": [{}]}, r"motion\.joints:"),
        (2, circle(HERE, 0.1), {"follow": ["w"]}, r"motion\.follow\.0:"),
    ],
)
def test_what_is_no_path_or_does_not_fit_the_arm_is_refused(links, path, more, words):
    with pytest.raises((MotionError, SceneError), match=words):
        lead(bars(*[0.5] * links), path, **more)
