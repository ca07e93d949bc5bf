"""What is narrow, in time (a law, a slope) or in a rate (friction about rest), is followed: no step passes over it."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.errors import NumericalError, SimulationStopped
from flexlin.linearization import Layers, Solver, balance, by_law, miss_between, saturating_arguments
from flexlin.periodic import FourierSeries
from flexlin.simulation import Drive
from tests.closed_arm import closed, opened
from tests.thinned import thin


@pytest.mark.slow
@pytest.mark.parametrize(("place", "width"), [(0.3123, 1e-3), (0.7171, 2e-4)])
def test_a_pulse_of_the_gain_brakes_the_joint_as_it_should(place: float, width: float) -> None:
    """It takes a factor e from the rate: by DOP853, with its place. Steps over it claimed 6e-12 and missed by 1.5e-7;
    a step to an edge of it ended 2e-16 s before, and "no step is short enough"."""
    lin = opened(changes={"links.0.modes": 0, "designs": []})[1]
    plant, T = lin.periodic_system(), lin.period
    strength = 1 / (float(plant.B(np.zeros(1))[0, 1, 0]) * width * T * np.sqrt(np.pi))

    def gain(t: np.ndarray) -> np.ndarray:
        pulse = strength * np.exp(-(((np.mod(t, T) - place * T) / (width * T)) ** 2))
        return np.stack([np.full(len(t), 30.0), pulse], axis=1)[:, None, :]

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        now = np.array([t])
        return (plant.A(now)[0] - plant.B(now)[0] @ gain(now)[0]) @ x

    x = np.array([1e-3, 0.0])
    run = fl.simulate(lin, periods=1.0, initial=x, feedback=gain, tol=1e-9)
    for begin, end in pairwise((0.0, (place - 6 * width) * T, (place + 6 * width) * T, T)):
        x = solve_ivp(rate, (begin, end), x, "DOP853", rtol=1e-11, atol=1e-16, max_step=(end - begin) / 50).y[:, -1]
    assert np.abs(run.linear[-1] - x).max() <= run.linear_error + 1e-12
    assert np.abs(run.nonlinear[-1] - x).max() < 1e-3 * np.abs(x).max()


def arm_with(damping: Callable[[ca.SX], ca.SX]) -> fl.Linearization:
    """A joint of inertia 0.5 kg m^2 that is the user's own model: q'' / 2 + damping(q') = tau."""
    q, q1 = ca.SX.sym("q"), ca.SX.sym("q1")
    arm = fl.Manipulator.from_matrices(q, q1, ca.SX(0.5), ca.SX(0), ca.SX(0), damping=damping(q1), names=["q"])
    scene = fl.load_scene("single-link")
    return fl.linearize(arm, scene.motion, scene.control)


def arm_with_friction(torque: float, rate: float) -> fl.Linearization:
    return arm_with(lambda q1: torque * ca.tanh(q1 / rate))


def by_lsoda(lin: fl.Linearization, resist: Callable, start: np.ndarray, end: float, limit: float) -> np.ndarray:
    """The state of that joint under its law at the end: LSODA on the scalar equation, its steps as short as the layer asks."""
    gain, omega = lin.law.gain(np.zeros(1))[0, 0], 2 * np.pi / lin.period

    def flow(t: float, x: np.ndarray) -> list[float]:
        rigid, q2 = 0.5 * omega * np.cos(omega * t), -0.5 * omega**2 * np.sin(omega * t)
        given = np.clip(0.5 * q2 + resist(rigid) - gain @ x, -limit, limit)
        return [x[1], (given - resist(rigid + x[1])) / 0.5 - q2]

    return solve_ivp(flow, (0, end), start, "LSODA", rtol=1e-9, atol=1e-12, max_step=lin.period / 4000).y[:, -1]


@pytest.mark.parametrize("rate", [1e-3, 1e-5])
@pytest.mark.parametrize("limit", [None, pytest.param(1.2, marks=pytest.mark.slow)])
def test_friction_about_rest_is_seen_wherever_the_joint_turns_round(rate: float, limit: float | None) -> None:
    """The joint turns round elsewhere than its motion does within rate / |q''| s. Steps over it missed by 5e-4 and claimed 2e-13."""
    lin, start = arm_with_friction(0.3, rate), np.array([0.03, -0.05])
    run = fl.simulate(lin, periods=0.5, initial=start, tol=1e-7, drive=Drive(limit=None if limit is None else (limit,)))
    expected = by_lsoda(lin, lambda q1: 0.3 * np.tanh(q1 / rate), start, run.t[-1], limit or np.inf)
    assert np.abs(run.nonlinear[-1] - expected).max() <= run.error + 2e-8


@pytest.mark.parametrize("drive", thin([{}, {"limit": (100.0,)}, {"rate": (1e9,)}]))
def test_a_pulse_of_the_torque_is_not_passed_over(drive: dict[str, tuple[float, ...]]) -> None:
    """A blow of 0.01 N m s within T / 5000 turns a joint of 0.5 kg m^2 by 0.02 rad/s, whoever integrates."""
    lin = arm_with_friction(0.0, 1.0)
    T, inertia, blow, width, place = lin.period, 0.5, 0.01, 2e-4 * lin.period, 0.07 * lin.period
    peak = blow / (width * np.sqrt(np.pi))

    def forward(t: np.ndarray) -> np.ndarray:
        return lin.law.forward(t) + peak * np.exp(-(((np.mod(t, T) - place) / width) ** 2))[:, None]

    struck = replace(lin.law, forward=forward)
    after = 0.2 * T - place
    free = replace(struck, gain=lambda t: np.zeros((len(t), 1, 2)))
    run = fl.simulate(lin, periods=0.2, law=free, drive=Drive(**drive), tol=1e-8)
    expected = [blow / inertia * after, blow / inertia]
    assert np.abs(run.nonlinear[-1] - expected).max() <= run.error + 1e-9
    assert np.abs(run.linear[-1] - expected).max() <= run.linear_error + 1e-9


def test_the_linear_answer_sees_the_slope_of_friction() -> None:
    """A pulse of the damping: y'' / 2 = -0.3 sech^2(q' / rate) y' / rate takes exp(-2 * 0.6 / |q''|) from the rate at the turn-around."""
    lin = arm_with_friction(0.3, 1e-4)
    free = replace(lin.law, gain=lambda t: np.zeros((len(t), 1, 2)))
    run = fl.simulate(lin, periods=0.5, initial=np.array([0.0, 1e-7]), law=free, tol=1e-9)
    turn = 0.25 * lin.period
    braking = abs(float(lin.motion.sample(np.array([turn]))[2][0, 0]))
    assert run.linear[-1, 1] / 1e-7 == pytest.approx(np.exp(-1.2 / braking), rel=1e-3)


@pytest.mark.slow
def test_a_loose_step_does_not_pass_over_the_slope_of_friction() -> None:
    """4e-5 rad/s wide, in windows that pass over it: without edges there the linear answer was off by 8e-2 and claimed 5e-6."""
    friction = {"torque": 0.01, "rate": 4e-5}
    lin = closed(changes={"motion.frequency": 0.86, "effects.coulomb_friction": friction})
    loose, exact = (fl.simulate(lin, 1.3, tol=tol) for tol in (1e-3, 1e-9))
    apart = np.abs(loose.linear - exact.linear).max()
    assert apart <= 1e-4 * np.abs(exact.linear).max()


def test_what_saturates_is_found_in_an_expression() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    shared = ca.tanh(100 * x)
    entries = shared * y + shared, ca.sin(ca.erf(y) + ca.atan(x * y)), 3 * ca.exp(-(y**2))
    found = saturating_arguments(ca.vertcat(*entries))
    at = ca.Function("at", [x, y], [ca.vertcat(*found)])(2.0, 3.0).full().ravel()
    assert sorted(at) == [-9.0, 3.0, 6.0, 200.0]
    assert saturating_arguments(ca.vertcat(x * y, ca.sin(x))) == []


@pytest.mark.slow
def test_a_periodic_motion_says_what_friction_does_between_its_points() -> None:
    """65 points claimed 7e-14 and missed by 6e-3; the truth is the fixed point of the simulated period."""
    lin = closed(changes={"links.0.modes": 1, "effects.coulomb_friction": {"torque": 0.02, "rate": 1e-3}})
    solver, layers = Solver(lin.about, balance(lin.about, by_law), lin.law, 65), Layers.of(lin.about)
    found = solver.solve(None)
    assert found is not None
    assert layers is not None
    y = FourierSeries.through(found[0][:, : lin.n], lin.period)
    claimed = miss_between(solver, layers, found[0])

    def after(state: np.ndarray) -> np.ndarray:
        return fl.simulate(lin, periods=1.0, initial=state, tol=1e-6, points_per_period=64).nonlinear

    state = np.concatenate([y(np.zeros(1))[0], y(np.zeros(1), 1)[0]])
    run = after(state)
    moved = np.array([after(state + 1e-5 * one)[-1] - run[-1] for one in np.eye(2 * lin.n)]).T / 1e-5
    for _ in range(2):
        state = state - np.linalg.solve(moved - np.eye(2 * lin.n), run[-1] - state)
        run = after(state)
    assert np.abs(run[-1] - state).max() < 1e-6
    t = np.linspace(0.0, lin.period, len(run))
    missed = np.abs(y(t) - run[:, : lin.n]).max() / np.abs(found[0][:, : lin.n]).max()
    assert 0.5 * missed < claimed < 3 * missed
    with pytest.raises(NumericalError, match="friction"):
        fl.control.periodic_motion(lin)


def test_a_rigid_arm_has_a_periodic_motion_too() -> None:
    """Its deviation is rounding: relative to that, no step of Newton's method was small."""
    motion = fl.control.periodic_motion(closed(changes={"links.0.modes": 0}))
    assert motion.error < 1e-8
    assert np.abs(motion(np.linspace(0, 2, 9))).max() < 1e-12


@pytest.mark.parametrize("drive", [{}, {"limit": (100.0,)}, {"rate": (1e9,)}])
def test_a_force_that_jumps_ends_the_run_in_words(drive: dict[str, tuple[float, ...]]) -> None:
    """An argument that jumps is passed by every step, however short: steps were tried without end."""
    lin = arm_with(lambda q1: ca.tanh(3 * ca.sign(q1)))
    with pytest.raises(SimulationStopped, match="no step is short enough"):
        fl.simulate(lin, periods=0.5, initial=np.array([0.03, -0.05]), tol=1e-5, drive=Drive(**drive))
