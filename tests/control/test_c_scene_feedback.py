"""The scene's own feedback in C: compiled, and in the place of Python's in equations that are put together and integrated here."""

import ctypes
import re

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.cli import main
from flexlin.control import gain_source, scene_feedback
from flexlin.errors import ArgumentError
from tests.control.test_c_controllers import SMALL, call, library, needs_compiler

PID = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
FILTERS = [
    {"kind": "low-pass", "on": "rates", "cutoff": "35 Hz", "order": 1},
    {"kind": "notch", "frequency": "4.5 Hz", "damping": 0.3, "gain": 0.2},
]


def arm_of(**changed):
    scene = fl.load_scene("single-link", {**SMALL, "designs": [], "control.feedback": PID, **changed})
    arm = fl.build_manipulator(scene)
    return fl.linearize(arm, scene.motion), fl.linearize(arm, scene.motion, scene.control)


@needs_compiler
@pytest.mark.slow
def test_an_arm_under_the_c_controller_moves_as_in_pythons_simulation(tmp_path):
    """Nonlinear equations from the manipulator's own residual, controller states by C's rates, DOP853; Python's by collocation."""
    plant, closed = arm_of(**{"control.filters": FILTERS})
    files = gain_source(scene_feedback(closed), plant.period, tmp_path, lin=plant, law=closed.law)
    c, T, arm, n = library(files), plant.period, plant.arm, plant.n
    start = np.array([0.02, -0.004, 0.1, 0.05])
    run = fl.simulate(closed, 0.15, start, tol=1e-11)
    force = ca.substitute(arm.residual, arm.s_ddot, ca.SX.zeros(arm.n, 1))
    pieces = ca.Function("pieces", [arm.s, arm.s_dot], [arm.M, force, arm.B])

    def rate(t, x):
        q, v, _ = (part[0] for part in plant.motion.sample(np.array([t])))
        joints = np.eye(arm.n)[:, : len(q)]
        M, f, B = (piece.full() for piece in pieces(x[:n] + joints @ q, x[n : 2 * n] + joints @ v))
        torque, z = call(c.gain_law, t / T, x, size=1), call(c.gain_rates, t / T, x, size=4)
        acceleration = np.linalg.solve(M, B @ torque - f[:, 0]) - joints @ plant.motion.sample(np.array([t]))[2][0]
        return np.concatenate([x[n : 2 * n], acceleration, z])

    x = np.concatenate([start, np.zeros(4)])
    known = solve_ivp(rate, (0.0, run.t[-1]), x, "DOP853", run.t, rtol=1e-12, atol=1e-14).y.T
    assert np.abs(known - np.hstack([run.nonlinear, run.controller])).max() < 1e-9
    assert np.abs(run.nonlinear).max() > 0.01


@needs_compiler
def test_the_c_source_of_a_pid_is_its_law_and_says_so(tmp_path):
    unwound = {"control.feedback": PID | {"tracking_time": 0.2}, "control.saturation": {"torque": [5.0]}}
    plant, closed = arm_of(**{"control.filters": FILTERS, **unwound})
    files = gain_source(scene_feedback(closed), plant.period, tmp_path, lin=plant, law=closed.law)
    c, law = library(files), closed.law
    rng = np.random.default_rng(2)
    t, x, missing = rng.uniform(0, plant.period, 5), rng.standard_normal((5, 8)), rng.standard_normal(1)
    for now, state, torque in zip(t, x, law.torque(t, x), strict=True):
        assert call(c.gain_law, now / plant.period, state, size=1) == pytest.approx(torque, rel=1e-11)
        rates = call(c.gain_rates, now / plant.period, state, size=4)
        np.testing.assert_allclose(rates, closed.controller.rates @ state, rtol=1e-13)
        found = rates.copy()
        c.gain_unwind(*(a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (missing, found)))
        np.testing.assert_allclose(found - rates, closed.controller.unwinding @ missing, atol=1e-12)
    header = files[1].read_text(encoding="utf-8")
    states = ["q1", "w11", "q1_rate", "w11_rate", "q1_filter1", "q1_integral", "q1_filter2_1", "q1_filter2_2"]
    assert re.findall(r"\[\d\] (\w+), ", header) == [*states, "q1"]
    assert "missing = asked - given" in header
    with pytest.raises(ArgumentError, match="no feedback"):
        scene_feedback(plant)


@needs_compiler
def test_the_command_writes_the_scenes_own_feedback(tmp_path):
    """Also of a motion that ends; `tracking_time` has no part where no drive is at its limit."""
    pid = 'control.feedback={kind="pid", kp=[3.0], kd=[0.5], ki=[2.0]}'
    sets = ["--set", "links.0.modes=1", "designs=[]", pid]
    ends = 'motion={kind="point-to-point", move_time=0.5, course="one-way", joints=[{waypoints=[0.0, 0.8]}]}'
    for name, more in {"periodic": [], "ending": [ends]}.items():
        assert main(["export", "single-link", *sets, *more, "--points", "8", "--out", str(tmp_path / name)]) == 0
        header = (tmp_path / name / "c-own" / "gain.h").read_text()
        assert "q1_integral, rad s" in header
        assert "unwind" not in header
        assert ("held at 0 before the motion" in header) == (name == "ending")
