"""Motions from logs: the period and the cycles of noisy records."""

import pickle

import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import LogMotion, TableMotion

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
        np.savetxt(tmp_path / f"{k}.csv", np.c_[t, q], delimiter=",")
        table = TableMotion(kind="table", file=str(tmp_path / f"{k}.csv"))
        if noise < 1e-3:
            assert fl.build_motion(table, 1).period == pytest.approx(3.7)
            continue
        with pytest.raises(fl.errors.MotionError, match=r"is noisy; got a peak acceleration of .*e.03 .* smooth part"):
            fl.build_motion(table, 1)
