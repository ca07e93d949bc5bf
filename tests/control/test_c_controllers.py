"""C controllers and estimators: compiled and called in the place of Python's, the scene's own feedback among them."""

import ctypes
import re
import shutil
import subprocess

import control
import numpy as np
import pytest
import scipy.io
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.cli import main
from flexlin.control import (
    design,
    estimator_source,
    gain_source,
    kalman_filter,
    periodic_plant,
    save,
    scene_feedback,
    to_control,
)
from flexlin.control.export.files import Labels, matlab_script
from flexlin.errors import ArgumentError
from tests.closed_arm import both, opened
from tests.thinned import thin

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


def call(function, *arguments, size):
    """Call a C function whose last argument is filled with `size` numbers."""
    out = np.zeros(size)
    kept = [np.ascontiguousarray(a, dtype=float) if np.ndim(a) else ctypes.c_double(a) for a in arguments]
    function(
        *[a.ctypes.data_as(NUMBERS) if isinstance(a, np.ndarray) else a for a in kept], out.ctypes.data_as(NUMBERS)
    )
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


def test_an_arm_that_nothing_drives_has_no_controller(tmp_path):
    scene = fl.load_scene("rotating-beam")
    lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    with pytest.raises(ArgumentError, match="no input"):
        gain_source(scene_feedback(lin), lin.period, tmp_path, lin=lin)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize(("kind", "least"), thin([("frozen-lqr", 1e-9), ("finite-horizon-lqr", 1e-5)]))
def test_a_gain_with_corners_is_met_on_either_side(kind, least, tmp_path):
    """There and back: the coefficients have corners at every way point. The header states how far C and Python are apart."""
    weights = {"joints": "1 deg", "rates": "20 deg/s", "deflection": 1e-2, "deflection_rates": 0.5, "input": 10.0}
    table = {"name": "made */ \\ \u201c", "kind": kind, "phases": 8, "weights": weights}
    scene, plant = opened("pick-and-place", {"links.0.modes": 1, "designs": [table]})
    made = design(plant, scene.designs[0], tol=1e-7)
    files = gain_source(made, plant.period, tmp_path, lin=plant)
    c, stated = library(files), float(re.search(r"flexlin's: (\S+) of", files[1].read_text(encoding="utf-8"))[1])
    corners = np.array(made.closed_loop.breaks)
    t = np.concatenate([np.linspace(0, plant.period, 401)[:-1] + 1e-4, corners + 1e-9, (corners - 1e-9)[corners > 0]])
    found = np.array([call(c.gain_matrix, now / plant.period, size=2 * 2 * plant.n) for now in t])
    wanted = made.K(t).reshape(len(t), -1)
    assert np.abs(found - wanted).max() < max(4 * stated, 1e-12) * np.abs(wanted).max()
    assert stated < least


@needs_compiler
@pytest.mark.slow
def test_steps_of_friction_are_met_inside(tmp_path):
    """Friction steps within T/5,000: gain and fed torques in C are those of Python inside the steps, to what the header states."""
    friction = {"effects.coulomb_friction": {"torque": 0.02, "rate": 1e-2}, "control.feedforward": "rigid"}
    scene, plant, lin = both("single-link", {**SMALL, **friction})
    made = design(plant, scene.designs[1], tol=1e-10)
    assert made.error < 1e-5
    files = gain_source(made, plant.period, tmp_path, lin=lin)
    c = library(files)
    stated = [
        float(x) for x in re.findall(r"(?:flexlin's|forward): (\d\S+e-\d+)", files[1].read_text(encoding="utf-8"))
    ]
    steps = [time + width * np.linspace(-9, 9, 61) for time, width in plant.features]
    t = np.sort(np.concatenate([np.linspace(0, plant.period, 61)[:-1], *steps]))
    at_rest = np.array([call(c.gain_law, now / plant.period, np.zeros(plant.n * 2), size=1) for now in t])
    K = np.array([call(c.gain_matrix, now / plant.period, size=2 * plant.n) for now in t])
    for found, wanted, error in zip((K, at_rest), (made.K(t)[:, 0], lin.law.forward(t)), stated, strict=True):
        assert np.abs(found - wanted).max() <= (4 * error + 1e-12) * np.abs(wanted).max()
        assert error < 1e-6


@pytest.mark.slow
@needs_compiler
def test_the_c_estimator_follows_the_filter(arm, tmp_path):
    """Its rate is that of the filter, and its step is of fourth order against an independent integrator."""
    _, plant, _ = arm
    system = plant.periodic_system()
    C = fl.control.joint_angles(plant)
    estimator = kalman_filter(system, C, np.diag([0, 0, 1.0, 1.0]), [[1e-4]], tol=1e-7)
    names = ["encoder of q1 in rad"]
    c, T = library(estimator_source(estimator, tmp_path, lin=plant, measurements=names)), plant.period
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
            assert c.estimator_step(at, step, *(v.ctypes.data_as(NUMBERS) for v in (measured, u, z))) == 0
        errors.append(np.abs(z - exact).max())
    assert errors[1] < 1e-5
    assert errors[0] / errors[1] > 12
    with pytest.raises(ArgumentError, match="measurements"):
        estimator_source(estimator, tmp_path, measurements=("a", "b"))


def test_python_control_systems_bear_the_arms_names(arm):
    _scene, plant, _ = arm
    labels, t = Labels.of(plant), np.array([0.2 * plant.period])
    frozen = to_control(plant, 0.2, np.eye(4)[:1], ["encoder"])
    assert isinstance(frozen, control.StateSpace)
    assert np.array_equal(frozen.A, plant.A(t)[0])
    assert np.array_equal(frozen.B, plant.input_matrix(t)[0])
    assert (frozen.state_labels, frozen.input_labels, frozen.output_labels) == (
        list(labels.states),
        ["q1"],
        ["encoder"],
    )
    assert periodic_plant(plant).state_labels == ["q1", "w11", "q1_rate", "w11_rate"]
    with pytest.raises(ArgumentError, match="phase"):
        to_control(plant, 1.0)
    with pytest.raises(ArgumentError, match="outputs"):
        to_control(plant, 0.2, np.eye(4), ["encoder"])


def test_the_matlab_script_reads_what_the_file_holds(arm, tmp_path):
    scene, plant, _ = arm
    made = design(plant, scene.designs[1], tol=1e-6)
    script = matlab_script(save(plant.periodic_system(), tmp_path / "system.mat", (made,), 8, plant), 1).read_text()
    data = scipy.io.loadmat(tmp_path / "system.mat")
    asked = set(re.findall(r"data\.(\w+)", script))
    assert asked <= set(data)
    assert set(re.findall(r"data\.designs\(i\)\.(\w+)", script)) <= set(data["designs"].dtype.names)
    assert {"A", "B", "t", "states", "state_units", "inputs", "designs"} <= asked
    assert [str(name[0]) for name in data["states"].ravel()] == ["q1", "w11", "q1_rate", "w11_rate"]
    assert script.count("function ") == 2
    assert script.count("\nend\n") >= 2
    assert "'system.mat'" in script


PID = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
FILTERS = [
    {"kind": "low-pass", "on": "rates", "cutoff": "35 Hz", "order": 1},
    {"kind": "notch", "frequency": "4.5 Hz", "damping": 0.3, "gain": 0.2},
]


def arm_with(**changed):
    return both("single-link", {**SMALL, "designs": [], "control.feedback": PID, **changed})[1:]


@needs_compiler
def test_the_c_source_of_a_pid_is_its_law_and_says_so(tmp_path):
    unwound = {"control.feedback": PID | {"tracking_time": 0.2}, "control.saturation": {"torque": [5.0]}}
    plant, closed = arm_with(**{"control.filters": FILTERS, **unwound})
    files = gain_source(scene_feedback(closed), plant.period, tmp_path, lin=plant, law=closed.law)
    c, law = library(files), closed.law
    rng = np.random.default_rng(2)
    t, x, missing = rng.uniform(0, plant.period, 5), rng.standard_normal((5, 8)), rng.standard_normal(1)
    for now, state, torque in zip(t, x, law.torque(t, x), strict=True):
        assert call(c.gain_law, now / plant.period, state, size=1) == pytest.approx(torque, rel=1e-11)
        rates = call(c.gain_rates, now / plant.period, state, size=4)
        np.testing.assert_allclose(rates, closed.controller.rates @ state, rtol=1e-13)
        found = rates.copy()
        c.gain_unwind(*(a.ctypes.data_as(NUMBERS) for a in (missing, found)))
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
