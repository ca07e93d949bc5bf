"""Basic motions: exact rates, closed periods, smooth joints, refusal of what is not periodic; the cycles of noisy logs."""

import pickle

import numpy as np
import pytest

import flexlin as fl
from flexlin.motion import build_motion
from flexlin.scene import LogMotion, TableMotion
from tests.mechanics.scenes import swinging

POINT = {"kind": "point-to-point", "move_time": 0.4, "joints": [{"waypoints": [0.0, 1.0]}]}
MOTIONS = {
    "harmonic": swinging({"mean": 0.1, "amplitude": 0.5, "phase": 0.3}, frequency=1.7),
    "rotation": {"kind": "rotation", "joints": [{"rate": -2.5, "start": 0.4}]},
    "fourier": {"kind": "fourier", "period": 0.9, "joints": [{"mean": 0.2, "cos": [0.3, 0.1], "sin": [0.0, -0.2, 0.05]}]},
    "quintic": {**POINT, "dwell_time": 0.1, "joints": [{"waypoints": [0.0, 1.0, 0.3]}]},
    "septic": {**POINT, "profile": "septic"},
}  # fmt: skip


@pytest.mark.parametrize("name", MOTIONS)
def test_rates_are_derivatives_and_a_period_closes(name):
    """Central differences away from the breaks converge with order 2."""
    m = build_motion(MOTIONS[name])
    t = m.period * np.array([0.03, 0.21, 0.47, 0.61, 0.83])
    _, q1, q2 = m.sample(t)
    gaps = []
    for step in (1e-3 * m.period, 5e-4 * m.period):
        up, down = m.sample(t + step), m.sample(t - step)
        gaps.append([np.abs((up[k] - down[k]) / (2 * step) - exact).max() for k, exact in ((0, q1), (1, q2))])
    for coarse, fine in zip(*gaps, strict=True):
        assert fine < 1e-9 or coarse / fine == pytest.approx(4.0, rel=0.05)
    for now, later in zip(m.sample(t), m.sample(t + 3 * m.period), strict=True):
        np.testing.assert_allclose(np.sin(later), np.sin(now), atol=1e-9)


@pytest.mark.parametrize("profile", ["quintic", "septic"])
def test_point_to_point_rests_at_its_waypoints(profile):
    times, joints = {"move_time": 0.5, "dwell_time": 0.25}, [{"waypoints": [0.2, 1.2]}]
    m = build_motion({"kind": "point-to-point", **times, "profile": profile, "joints": joints})
    assert m.period == pytest.approx(1.5)
    np.testing.assert_allclose(m.breaks, [0.0, 0.5, 0.75, 1.25])
    q, q1, q2 = m.sample(np.array([0.0, 0.5, 0.6, 0.75, 1.25, 1.4]))
    np.testing.assert_allclose(q[:, 0], [0.2, 1.2, 1.2, 1.2, 0.2, 0.2], atol=1e-13)
    np.testing.assert_allclose(q1, 0.0, atol=1e-12)
    np.testing.assert_allclose(q2, 0.0, atol=1e-11)


def test_one_way_motion_ends():
    m = build_motion({**POINT, "course": "one-way"})
    assert not m.periodic
    np.testing.assert_allclose(m.sample(np.array([0.4, 2.0]))[0][:, 0], 1.0)


def test_rotations_share_a_period():
    m = build_motion({"kind": "rotation", "joints": [{"rate": 3.0}, {"rate": -2.0}, {"rate": 0.0}]})
    assert m.period == pytest.approx(2 * np.pi)
    q, q1, _ = m.sample(np.array([0.5]))
    np.testing.assert_allclose(q[0], [1.5, -1.0, 0.0], atol=1e-14)
    np.testing.assert_allclose(q1[0], [3.0, -2.0, 0.0], atol=1e-14)


def test_joints_that_do_not_move_together_are_refused():
    for table, says in (
        ({"kind": "rotation", "joints": [{"rate": 0.0}]}, "no joint turns"),
        ({"kind": "rotation", "joints": [{"rate": 1.0}, {"rate": np.sqrt(2.0)}]}, "no common period"),
        ({**MOTIONS["quintic"], "joints": [{"waypoints": [0.0, 1.0]}, {"waypoints": [0.0, 1.0, 2.0]}]}, "unequal"),
    ):
        with pytest.raises(fl.errors.MotionError, match=says):
            build_motion(table)


@pytest.mark.parametrize(
    ("default", "own", "expected"),
    [("torque", "prescribed", True), ("prescribed", None, True), ("prescribed", "torque", False)],
)
def test_drive_of_a_joint_overrides_the_default(default, own, expected):
    joint = {"amplitude": 0.1} | ({"drive": own} if own else {})
    assert build_motion(swinging(joint, drive=default)).prescribed == (expected,)


def read(path, t, q):
    np.savetxt(path, np.column_stack([t, q]), delimiter=",", header="t,q1", comments="")
    return build_motion(TableMotion(kind="table", file=str(path)), 1)


def test_table_converges_with_its_spacing(tmp_path):
    """A quintic spline's second derivative is of order 4 in the spacing."""
    angle, gaps = 2 * np.pi * np.linspace(0, 1, 333), []
    exact = (2 * np.pi) ** 2 * (np.cos(angle) ** 2 - np.sin(angle)) * np.exp(np.sin(angle))
    for rows in (41, 81):
        t = np.linspace(0, 1.0, rows)
        m = read(tmp_path / f"{rows}.csv", t, np.exp(np.sin(2 * np.pi * t)))
        gaps.append(np.abs(m.sample(angle / (2 * np.pi))[2][:, 0] - exact).max())
    assert np.log2(gaps[0] / gaps[1]) > 3.5


def test_table_may_turn_around(tmp_path):
    t = np.linspace(0, 2.0, 21)
    m = read(tmp_path / "turn.csv", t, np.pi * t + 0.1 * np.sin(np.pi * t))
    _, q1, _ = m.sample(np.array([0.3, 2.3]))
    np.testing.assert_allclose(q1[0], q1[1], rtol=1e-12)
    np.testing.assert_allclose(q1[0], np.pi + 0.1 * np.pi * np.cos(0.3 * np.pi), rtol=1e-4)


def test_the_number_of_joints_is_the_tables_or_the_arms():
    assert build_motion(swinging({"amplitude": 0.1}, {"amplitude": 0.2})).joints == 2
    with pytest.raises(fl.errors.ArgumentError, match="joints are not known; got 0"):
        build_motion({"kind": "log", "file": "log.csv", "columns": ["q"]})


T = np.arange(3000) * 0.005


def read_log(folder, text, joints=1, **table):
    """The motion of a log of this text."""
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    return fl.build_motion(LogMotion(kind="log", file=str(path), columns=("angle",), **table), joints)


def rows(q):
    """The text of a log."""
    return "t,angle\n" + "".join(f"{t:.6f},{value:.9f}\n" for t, value in zip(T, q, strict=True))


def test_noise_is_left_out_and_the_period_found(tmp_path):
    """2 mrad of noise at 200 Hz, which a spline turns into more than 100 rad/s^2."""
    w = 2 * np.pi / 3.7
    smooth = 0.4 * np.sin(w * T) + 0.1 * np.cos(3 * w * T)
    motion = read_log(tmp_path, rows(smooth + 2e-3 * np.random.default_rng(0).standard_normal(len(T))))
    assert motion.period == pickle.loads(pickle.dumps(motion)).period == pytest.approx(3.7, rel=2e-3)
    q, _, acceleration = motion.sample(T[:700])
    assert np.abs(q[:, 0] - smooth[:700]).max() < 4e-3
    assert np.abs(acceleration).max() < 1.2 * (0.4 * w**2 + 0.9 * w**2)


def test_it_says_what_was_averaged_kept_and_left_out(tmp_path):
    """15 s of 2 s: seven whole cycles; 2 mrad of noise; three rows without a number."""
    q = 0.3 * np.sin(np.pi * T) + 0.05 * np.cos(3 * np.pi * T) + 2e-3 * np.random.default_rng(1).standard_normal(len(T))
    q[[40, 41, 900]] = np.nan
    said = read_log(tmp_path, rows(q)).origin
    assert said.startswith("7 cycles of 2.00")
    assert "; 3 harmonics kept, 0.002 RMS left out" in said
    assert said.endswith("; 3 of 3000 rows left out, which hold no numbers")


def test_a_log_drives_a_nonlinear_simulation(tmp_path):
    """The series' derivatives are strided views, which compiled code does not take."""
    scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    motion = read_log(tmp_path, rows(0.3 * np.sin(np.pi * T)))
    lin = fl.linearize(fl.build_manipulator(scene), motion, scene.control)
    assert fl.simulate(lin, periods=1, tol=1e-4).status


REPEATING = rows(np.sin(2 * np.pi * T / 1.25))
LINES = REPEATING.splitlines()
BROKEN = "\n".join([LINES[0], *[line if i % 3 else "x,y" for i, line in enumerate(LINES[1:])]])


@pytest.mark.parametrize(
    ("words", "text", "more"),
    [
        ("does not repeat", rows(np.sin(0.3 * T**1.5)), {}),
        ("one name a joint", rows(np.sin(T)), {"joints": 2}),
        ("does not repeat every 1.7 s", REPEATING, {"period": 1.7}),
        ("less than two cycles", "\n".join(LINES[:201]), {}),
        ("got semicolons", REPEATING.replace(",", ";"), {}),
        ("1000 of 3000 rows", BROKEN, {}),
    ],
)
def test_a_log_of_no_motion_is_refused_in_words(tmp_path, words, text, more):
    with pytest.raises(fl.errors.MotionError, match=words):
        read_log(tmp_path, text, **more)


@pytest.mark.parametrize("noise", [0.0, 1e-6, 2e-3])
def test_a_noisy_table_is_refused_beside_the_acceleration_of_its_smooth_part(tmp_path, noise):
    """A spline through 2 mrad of noise at 200 Hz has some 2,000 rad/s^2 where the motion has 3.6; kinks and rounding are no noise."""
    t = np.linspace(0, 3.7, 741)
    w, rng = 2 * np.pi / 3.7, np.random.default_rng(0)
    smooth, kinked = 0.4 * np.sin(w * t) + 0.1 * np.cos(3 * w * t), np.abs(t / 3.7 - 0.5)
    for k, q in enumerate((smooth, kinked)):
        q = q + noise * rng.standard_normal(len(t))
        q[-1] = q[0]
        if noise < 1e-3:
            assert read(tmp_path / f"{k}.csv", t, q).period == pytest.approx(3.7)
            continue
        with pytest.raises(fl.errors.MotionError, match=r"is noisy; got a peak acceleration of .*e.03 .* smooth part"):
            read(tmp_path / f"{k}.csv", t, q)
