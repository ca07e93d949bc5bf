"""Sensors: against differences of positions and the beam's own shape. What the drives have to do: against the simulation, a motor's own
equations, and limits that do not fit. Weights in physical sizes: Bryson's rule through the arm's own tip, for any number of modes."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

import flexlin as fl
from flexlin.analyses import analyse
from flexlin.control import bending, design, drive_load, physical_weights, tip_acceleration, tip_position
from flexlin.control.sensors import READINGS, tip_zeros
from flexlin.errors import ArgumentError
from flexlin.report import advise, record, to_json
from flexlin.report.advice import comment_on_zeros
from flexlin.scene import Weights
from flexlin.scene.scene import Sensor
from flexlin.simulation import tip_positions
from tests.closed_arm import both, closed, opened
from tests.periodic.dense import at, integrate

SMALL = {"links.0.modes": 1}


@pytest.fixture(scope="module")
def lin():
    return opened()[1]


def test_strain_gauge_at_the_root_of_a_cantilever(lin):
    """X'' = 2 (beta l)^2 / l^2 at the root, 0 at the free end, for every clamped-free mode (Blevins, Formulas, ch. 8)."""
    beta, scene = np.array([1.8751040687119611, 4.694091132974174]), fl.load_scene("single-link")
    root, end = (bending(scene, lin, 0, place)(np.zeros(1))[0, 0] for place in (0.0, 1.0))
    np.testing.assert_allclose(root[1:3], 2 * beta**2 / 0.96**2, rtol=1e-10)
    np.testing.assert_allclose(end, 0.0, atol=1e-9)
    with pytest.raises(ArgumentError, match="not on the link"):
        bending(scene, lin, 0, 1.5)


def test_accelerometer_is_the_second_derivative_of_the_camera(lin):
    """Along a linear motion under a constant torque: second differences of C_position x, by DOP853."""
    system, torque, h = lin.periodic_system(), np.array([0.3]), 1e-4
    t, start = 0.4 + h * np.arange(3), [0.02, 0.01, -0.003, 0.1, 0.2, -0.1]
    x = integrate(lambda t, x: at(system.A, t) @ x + at(system.B, t) @ torque, start, t)
    seen = np.einsum("tij,tj->ti", tip_position(lin)(t), x)
    C, D = tip_acceleration(lin)
    felt = C(t)[1] @ x[1] + D(t)[1] @ torque
    np.testing.assert_allclose((seen[0] - 2 * seen[1] + seen[2]) / h**2, felt, rtol=0, atol=1e-4 * np.abs(felt).max())


def test_every_sensor_that_a_log_may_name_is_read():
    """A kind that only the scene's schema knows would end in a KeyError."""
    assert set(get_args(Sensor)) - {"coordinate", "rate"} <= set(READINGS)


def test_a_report_names_the_zero_that_bounds_every_controller():
    found = analyse(fl.load_scene("single-link", SMALL | {"designs": []}))
    zeros, exact = found.zeros, tip_zeros(found.plant)
    assert np.all(np.abs(zeros.exponents.real - exact.exponents.real) <= zeros.errors + exact.errors)
    marginal = replace(zeros, exponents=np.append(zeros.exponents, 1e-16), errors=np.append(zeros.errors, 1e-9))
    said = [next(comment_on_zeros(replace(found, zeros=one))) for one in (zeros, marginal)]
    assert "non-minimum phase" in said[0] == said[1]  # one whose real part is rounding bounds nothing
    # far beyond every mode of the arm
    assert not [*comment_on_zeros(replace(found, zeros=replace(zeros, exponents=100 * zeros.exponents)))]


@pytest.mark.slow
def test_rounding_of_an_outputs_derivatives_is_not_chased():
    """A slow pick-and-place: narrower and narrower panels followed it, until none was left to try."""
    found = tip_zeros(closed("pick-and-place", {"motion.move_time": 1.0, "motion.dwell_time": 1.0}))
    assert found.verdict == "non-minimum phase"
    assert found.exponents[0].real == pytest.approx(3222, abs=1)


@pytest.mark.slow
def test_the_work_of_the_drives_is_what_the_simulation_says():
    """Torque as simulated; the power integrated over a period is the work done on the arm, by its energy and damping."""
    lin = closed("de-luca-siciliano-1991")
    run = fl.simulate(lin, 1, tol=1e-8, points_per_period=1024)
    load = drive_load(lin, run.t, run.nonlinear, lin.law)
    np.testing.assert_allclose(load.torque, run.torque, atol=1e-12)
    y, v = np.hsplit(run.nonlinear, 2)
    energy = lin.about.of_arm("energy", run.t, y, v)[:, 0, 0]
    rates = lin.about.positions(run.t, y, v)[1]
    lost = np.einsum("ti,ti->t", rates, lin.about.of_arm("damping", run.t, y, v)[:, :, 0])
    left = energy[-1] - energy[0] + lin.period * lost[:-1].mean()
    given = lin.period * load.power[:-1].mean(axis=0).sum()
    assert given == pytest.approx(left, abs=2e-3 * np.abs(load.power).max())
    found = {(demand.what, demand.joint): demand.value for demand in load.demands}
    assert found["peak torque", "q2"] == np.abs(run.torque[:, 1]).max()
    assert found["peak power", "q1"] == np.abs(load.power[:, 0]).max()


def test_a_motors_current_is_that_of_its_winding():
    """u = R i + k N q', torque = N k i; the same torque by a constant of the drives' table."""
    motor = {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": 30.0}
    gains = {"control.feedback.kp": [12.0], "control.feedback.kd": [1.0]}
    lin = closed("single-link", {**SMALL, "effects.motor": motor, **gains})
    t, x = np.linspace(0, lin.period, 64, endpoint=False), 0.1 * np.random.default_rng(3).normal(size=(64, 4))
    load, u = drive_load(lin, t, x, lin.law), lin.law.torque(t, x)
    assert load.current is not None
    np.testing.assert_allclose(u, 2.0 * load.current + 0.05 * 30 * load.speed, rtol=1e-12)
    np.testing.assert_allclose(load.torque, 1.5 * load.current, rtol=1e-12)
    assert lin.input_units == ("V",)
    scene, _, plain = both("single-link", {**SMALL, "drives": {"torque_constant": "1.5 N m/A"}})
    other = drive_load(plain, t, x, plain.law, scene.drives)
    np.testing.assert_allclose(other.torque, 1.5 * other.current, rtol=1e-12)


@pytest.mark.slow
def test_the_report_marks_loops_above_their_drives_and_sampled_ones():
    drives = {"torque": {"peak": "1.1 N m", "continuous": "5 N m"}, "speed": "300 deg/s"}
    weights, sampling = {"joints": "0.5 deg", "rates": "5 deg/s", "input": "0.5 N m"}, {"period": 0.004, "delay": 0.001}
    table = [{"name": "LQR", "kind": "periodic-lqr", "weights": weights}]
    overrides = {**SMALL, "drives": drives, "designs": table, "control.sampling": sampling, "accuracy.tol": 1e-6}
    found = analyse(fl.load_scene("single-link", overrides))
    load, data = found.load(found.own), record(found)
    assert [(demand.what, demand.limit) for demand in load.exceeded] == [("peak torque", 1.1)]
    assert found.load(found.open_loop) is None, "it keeps no steady motion"
    assert data["floquet"]["drives"]["exceeds"] is True
    assert data["designs"]["LQR"]["drives"]["demands"][0]["what"] == "peak torque"
    assert to_json(data)
    said = " ".join(advise(found))
    assert "asks more than the drives give: peak torque of q1" in said
    verdicts = {loop.name: loop.verdict for loop in found.sampled}
    assert verdicts == {"scene's PD, sampled": "stable", "LQR, sampled": "unstable"}
    assert "Sampled every 4 ms and 1 ms late, the LQR is unstable" in said


def test_limits_that_do_not_fit_are_refused_before_any_work():
    for drives, words in (
        ({"torque": {"peak": ["1 N m", "2 N m"]}}, "2 quantities"),
        ({"speed": "1 m/s"}, "another unit"),
        ({"torque": {"peak": "3 N"}}, "unit"),
    ):
        with pytest.raises(ArgumentError, match=words):
            analyse(fl.load_scene("single-link", {"drives": drives}))


WITH_DESIGNS = [name for name in fl.scenes() if fl.load_scene(name).designs]


def weigh(lin, **sizes):
    return physical_weights(lin, Weights.model_validate({"input": 1.0, **sizes}))


def test_a_state_at_its_sizes_costs_their_number():
    """Each deviation at its acceptable size costs 1; the tip's part is measured by moving the nonlinear arm."""
    _, lin = opened("de-luca-siciliano-1991")
    sizes = {"joints": ["0.5 deg", "1 deg"], "rates": "5 deg/s", "deflection": "1 mm", "w21": "3 mm"}
    sizes["input"] = ["3 N m", 2.0]
    Q, R = weigh(lin, tip="2 mm", **sizes)
    bare, _ = weigh(lin, **sizes)
    deg, t = np.pi / 180, np.array([0.0, 0.7, 3.1])
    at_sizes = np.array([0.5 * deg, deg, 1e-3, 1e-3, 3e-3, 1e-3, 5 * deg, 5 * deg, 0, 0, 0, 0])
    assert at_sizes @ bare(t)[0] @ at_sizes == pytest.approx(8.0, rel=1e-12)
    assert np.diag(R) == pytest.approx([1 / 9, 1 / 4])
    y = np.random.default_rng(1).normal(size=(1, 12)) * 1e-6
    moved = [tip_positions(lin, t, np.repeat(sign * y, 3, axis=0)) for sign in (1, -1)]
    by_tip = np.sum((moved[0] - moved[1]) ** 2, axis=1) / 4 / 2e-3**2
    assert [(y @ (Q(t) - bare(t))[k] @ y.T).item() for k in range(3)] == pytest.approx(by_tip, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_DESIGNS)
def test_built_in_designs_bear_any_number_of_modes(name):
    for modes in (1, 2 if name == "spatial-four-bar" else 4):  # its links bend and twist, each in so many shapes
        scene, lin = opened(name, {"links.0.modes": modes})
        for table in scene.designs:
            assert fl.floquet(design(lin, table, tol=1e-6).closed_loop, tol=1e-6).verdict == "stable"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flexible-joint-link", "five-bar"])
def test_fast_modes_leave_the_cost_exact(name):
    """Modes up to 80,000 rad/s: the cost has the few harmonics of the motion, which the ringing of a coarse start must not hide."""
    scene, lin = opened(name, {"links.0.modes": 5})
    assert design(lin, scene.designs[0], tol=1e-9).solution.error < 1e-9


def test_sizes_that_do_not_fit_the_arm_are_refused():
    lin, two = (opened(name)[1] for name in ("arm-on-carriage", "three-link"))
    for sizes, words in (
        ({"joints": "2 mm"}, "weights.joints has another unit"),
        ({"input": "3 V"}, "weights.input has another unit"),
        ({"w13": "2 mm"}, "unknown key"),
        ({"w11": "2 deg"}, "weights.w11|unknown key"),
        ({"joints": ["1 deg", "1 deg"]}, "2 quantities|2 sizes"),
        ({"input": [1.0, 1.0]}, "2 quantities|2 sizes"),
    ):
        with pytest.raises(ArgumentError, match=words):
            weigh(lin, **sizes)
    assert weigh(two, joints=["1 deg", "2 deg", "3 deg"])[0](np.zeros(1)).shape[-1] == 2 * two.n
    with pytest.raises(ArgumentError, match="to know the coordinates"):
        design(lin.periodic_system(), fl.load_scene("single-link").designs[0])


@pytest.mark.slow
def test_strict_weights_on_cheap_inputs_are_solved():
    """Modes of the loop decay in microseconds and X changes in kinks: it keeps Riccati's equation, integrated by SciPy."""
    _, lin = opened("pick-and-place")
    Q, R = weigh(lin, tip="5 mm", joints="0.5 deg", rates="10 deg/s", input="3 N m")
    found, system = fl.periodic_lqr(lin, Q, R, tol=1e-9), lin.periodic_system()
    assert found.status == "converged"
    assert found.error <= 1e-9

    def fall(t, X):
        A, pull = at(system.A, t), at(system.B, t).T @ X
        return -(X @ A + A.T @ X - pull.T @ np.linalg.solve(R, pull) + at(Q, t))

    wanted = integrate(fall, found.X(1.0), [1.0, 0.996], rtol=1e-8, atol=1e-12)[-1]
    assert np.abs(found.X(0.996) - wanted).max() <= max(1e-7, found.error) * np.abs(wanted).max()
