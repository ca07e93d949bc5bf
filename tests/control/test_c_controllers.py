"""C controllers and estimators: compiled and called in the place of Python's, the scene's own feedback among them."""

import ctypes
import re
import shutil
import subprocess

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.cli import main
from flexlin.control import design, estimator_source, gain_source, kalman_filter, scene_feedback
from flexlin.errors import ArgumentError
from tests.closed_arm import both
from tests.closed_arm import closed as closed_loop

COMPILER = shutil.which("cc") or shutil.which("gcc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")
NUMBERS = ctypes.POINTER(ctypes.c_double)
SMALL = {"links.0.modes": 1}


def library(files):
    """The compiled sources without main, as strict C99."""
    folder, sources = files[0].parent, [str(file) for file in files if file.suffix == ".c" and file.stem != "main"]
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC"]
    subprocess.run([COMPILER, *strict, *sources, "-lm", "-o", str(folder / "library.so")], check=True)
    return ctypes.CDLL(str(folder / "library.so"))


def pointer(values):
    return np.ascontiguousarray(values, dtype=float).ctypes.data_as(NUMBERS)


def call(function, *arguments, size):
    """Call a C function whose last argument is filled with `size` numbers."""
    out = np.zeros(size)
    function(*[pointer(a) if np.ndim(a) else ctypes.c_double(a) for a in arguments], out.ctypes.data_as(NUMBERS))
    return out


@pytest.fixture(scope="module")
def arm():
    return both("single-link", SMALL)


@needs_compiler
def test_the_c_controller_asks_for_the_torque_of_its_law(arm, tmp_path):
    """Gain and feedforward; and the header says where each state stands."""
    scene, plant, _ = arm
    made, rng = design(plant, scene.designs[1]), np.random.default_rng(4)
    files = gain_source(made, plant.period, tmp_path, lin=plant)
    c, T = library(files), plant.period
    t, states = rng.uniform(0, T, 9), 0.1 * rng.normal(size=(9, 4))
    for now, x, torque in zip(t, states, plant.law.with_gain(made.K).torque(t, states), strict=True):
        np.testing.assert_allclose(call(c.gain_law, now / T, x, size=1), torque, rtol=1e-11, atol=1e-11)
        assert call(c.gain, 3.0 + now / T, x, size=1) == pytest.approx(-made.K(np.array([now]))[0] @ x, rel=1e-11)
    order = re.findall(r"\[(\d)\] (\w+), (\S+(?: m)?)\n", files[1].read_text(encoding="utf-8"))
    units = ("rad", "m", "rad/s", "m/s", "N m")
    names = ("q1", "w11", "q1_rate", "w11_rate", "q1")
    assert order == [(str(i % 4), name, unit) for i, (name, unit) in enumerate(zip(names, units, strict=True))]


WEIGHTS = {"joints": "1 deg", "rates": "20 deg/s", "deflection": 1e-2, "deflection_rates": 0.5, "input": 10.0}
CORNERS = {"name": "made */ \\ \u201c", "phases": 8, "weights": WEIGHTS}
FRICTION = {"effects.coulomb_friction": {"torque": 0.02, "rate": 1e-2}, "control.feedforward": "rigid"}


CLOSE = [
    ("pick-and-place", {"designs": [CORNERS | {"kind": "frozen-lqr"}]}, 1e-9),
    ("pick-and-place", {"designs": [CORNERS | {"kind": "finite-horizon-lqr"}]}, 1e-5),
    ("single-link", FRICTION, 1e-6),
]


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize(("name", "changes", "least"), CLOSE)
def test_corners_are_met_on_either_side_and_steps_of_friction_inside(name, changes, least, tmp_path):
    """There and back, with corners at every way point; and friction that steps within T/5,000. The header states how far gain and fed
    torques in C and Python are apart."""
    scene, plant, lin = both(name, {**SMALL, **changes})
    made, n = design(plant, scene.designs[-1], tol=1e-10 if changes == FRICTION else 1e-7), 2 * plant.n
    files, m = gain_source(made, plant.period, tmp_path, lin=lin), len(plant.driven)
    c, header = library(files), files[1].read_text(encoding="utf-8")
    corners, grid = np.array(made.closed_loop.breaks), np.linspace(0, plant.period, 401)[:-1] + 1e-4
    steps = [at + width * np.linspace(-9, 9, 61) for at, width in plant.features]
    t = np.concatenate([grid, corners + 1e-9, (corners - 1e-9)[corners > 0], *steps])
    K = np.array([call(c.gain_matrix, now / plant.period, size=m * n) for now in t])
    fed = np.array([call(c.gain_law, now / plant.period, np.zeros(n), size=m) for now in t])
    stated = [float(x) for x in re.findall(r"(?:flexlin's|forward): (\d\S*e-\d+)", header)]
    for found, wanted, error in zip((K, fed), (made.K(t).reshape(len(t), -1), lin.law.forward(t)), stated, strict=True):
        assert np.abs(found - wanted).max() <= (4 * error + 1e-12) * np.abs(wanted).max()
        assert error < least


@pytest.mark.slow
@needs_compiler
def test_the_c_estimator_follows_the_filter(arm, tmp_path):
    """Its rate is that of the filter, and its step is of fourth order against an independent integrator."""
    _, plant, _ = arm
    system, C, T = plant.periodic_system(), fl.control.joint_angles(plant), plant.period
    estimator = kalman_filter(system, C, np.diag([0, 0, 1.0, 1.0]), [[1e-4]], tol=1e-7)
    c = library(estimator_source(estimator, tmp_path, lin=plant, measurements=["encoder of q1 in rad"]))
    x, measured, u = np.array([0.1, -0.02, 0.3, 0.5]), np.array([0.07]), np.array([0.4])

    def rate(t, z):
        now = np.array([t])
        L, A = estimator.L(now)[0], system.A(now)[0]
        return A @ z + system.B(now)[0] @ u + L @ (measured - C(now)[0] @ z)

    for phase in (0.0, 0.37, 12.9):
        np.testing.assert_allclose(call(c.estimator_rate, phase, x, measured, u, size=4), rate(phase * T, x), rtol=1e-9)
    span, errors = 0.04, []
    exact = solve_ivp(rate, (0.3, 0.3 + span), x, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    for count in (8, 16):
        z = x.copy()
        for k in range(count):
            at, step = (ctypes.c_double(v) for v in ((0.3 + k * span / count) / T, span / count))
            assert c.estimator_step(at, step, *map(pointer, (measured, u, z))) == 0
        errors.append(np.abs(z - exact).max())
    assert errors[1] < 1e-5
    assert errors[0] / errors[1] > 12
    with pytest.raises(ArgumentError, match="measurements"):
        estimator_source(estimator, tmp_path, measurements=("a", "b"))


PID = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
NOTCH = {"kind": "notch", "frequency": "4.5 Hz", "damping": 0.3, "gain": 0.2}
FILTERS = [{"kind": "low-pass", "on": "rates", "cutoff": "35 Hz", "order": 1}, NOTCH]


@needs_compiler
def test_the_c_source_of_a_pid_is_its_law_and_says_so(tmp_path):
    unwound = {"control.feedback": PID | {"tracking_time": 0.2}, "control.saturation": {"torque": [5.0]}}
    plant, closed = both("single-link", {**SMALL, "designs": [], "control.filters": FILTERS, **unwound})[1:]
    files = gain_source(scene_feedback(closed), plant.period, tmp_path, lin=plant, law=closed.law)
    c, law = library(files), closed.law
    rng = np.random.default_rng(2)
    t, x, missing = rng.uniform(0, plant.period, 5), rng.standard_normal((5, 8)), rng.standard_normal(1)
    for now, state, torque in zip(t, x, law.torque(t, x), strict=True):
        assert call(c.gain_law, now / plant.period, state, size=1) == pytest.approx(torque, rel=1e-11)
        rates = call(c.gain_rates, now / plant.period, state, size=4)
        np.testing.assert_allclose(rates, closed.controller.rates @ state, rtol=1e-13)
        found = rates.copy()
        c.gain_unwind(pointer(missing), pointer(found))
        np.testing.assert_allclose(found - rates, closed.controller.unwinding @ missing, atol=1e-12)
    header = files[1].read_text(encoding="utf-8")
    states = ["q1", "w11", "q1_rate", "w11_rate", "q1_filter1", "q1_integral", "q1_filter2_1", "q1_filter2_2"]
    assert re.findall(r"\[\d\] (\w+), ", header) == [*states, "q1"]
    assert "missing = asked - given" in header
    with pytest.raises(ArgumentError, match="no feedback"):
        scene_feedback(plant)
    undriven = closed_loop("rotating-beam")
    with pytest.raises(ArgumentError, match="no input"):
        gain_source(scene_feedback(undriven), undriven.period, tmp_path, lin=undriven)


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
