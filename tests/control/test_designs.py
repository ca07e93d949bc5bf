"""Every kind of design and the Kalman filter: costs that agree with integration, optimality, and named refusals; static output feedback
against a search by SciPy on constant Lyapunov equations, and the same in turning coordinates."""

import control
import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize

import flexlin as fl
from flexlin.control import averaged_lqr, design, finite_horizon_lqr, frozen_lqr, kalman_filter, periodic_lqr
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable
from flexlin.scene.control import DesignTable
from tests.closed_arm import opened
from tests.periodic.dense import at, integrate
from tests.periodic.systems import turn, turned
from tests.thinned import thin

KINDS = ("periodic-lqr", "frozen-lqr", "averaged-lqr", "finite-horizon-lqr")


def pendulums(depth=0.8, damping=0.02):
    """Two coupled oscillators, one driven, whose stiffness swings through a parametric resonance."""

    def stiffness(t):
        out = np.tile(np.array([[2.0, -0.6], [-0.6, 1.3]]), (len(t), 1, 1))
        out[:, 0, 0] += depth * np.cos(2 * t)
        out[:, 1, 1] += depth * np.sin(2 * t)
        return out

    M, B = np.array([[1.5, 0.2], [0.2, 1.0]]), np.array([[1.0], [0.0]])
    return fl.PeriodicSystem.from_second_order(M, damping * np.eye(2), stiffness, np.pi, B)


Q, R = np.diag([2.0, 2.0, 1.0, 1.0]), np.array([[0.5]])


def table(kind, **changes):
    content = {"name": "mine", "kind": kind, "phases": 24, "state_weight": np.diag(Q), "input_weight": np.diag(R)}
    return DesignTable.model_construct(**(content | changes))


DESIGNS = [periodic_lqr(pendulums(), Q, R), frozen_lqr(pendulums(), Q, R, phases=24), averaged_lqr(pendulums(), Q, R)]


@pytest.mark.slow
@pytest.mark.parametrize("made", DESIGNS, ids=lambda made: made.kind)
def test_cost_is_the_integral_along_the_loop(made):
    """Of x' Q x + u' R u, by SciPy."""
    x0 = np.array([0.3, -0.2, 0.1, 0.4])

    def rate(t, z):
        x, u = z[:-1], -at(made.K, t) @ z[:-1]
        return np.append(at(made.closed_loop.A, t) @ x, x @ Q @ x + u @ R @ u)

    cost = integrate(rate, np.append(x0, 0.0), [0.0, 40 * np.pi], rtol=1e-10)[-1, -1]
    assert made.cost(x0) == pytest.approx(cost, rel=1e-7)


C, W, V = np.eye(1, 4), np.diag([0.0, 0.0, 0.5, 0.2]), np.array([[0.01]])


def test_constant_system_gives_the_lqr_and_filter_of_python_control_in_every_kind():
    system, t = pendulums(depth=0.0), np.array([0.0, 1.0, 4.0])
    A, B = at(system.A, 0.0), at(system.B, 0.0)
    K, X, poles = control.lqr(A, B, Q, R)
    for kind in KINDS:
        made = design(system, table(kind))
        assert (made.name, made.kind) == ("mine", kind)
        assert np.abs(made.K(t) - K).max() < 1e-8
        assert np.abs(made.X(t) - X).max() < 1e-8 * np.abs(X).max()
        real = np.sort(fl.floquet(made.closed_loop).exponents.real)
        assert np.abs(real - np.sort(poles.real)).max() < 1e-7
    L, P, _ = control.lqe(A, np.eye(4), C, W, V)
    found = kalman_filter(system, C, W, V, tol=1e-11)
    assert np.abs(found.P(t) - P).max() < 1e-9 * np.abs(P).max()
    assert np.abs(found.L(t) - L).max() < 1e-9 * np.abs(L).max()


def test_covariance_obeys_its_equation_forward_in_time():
    system, stops = pendulums(), np.array([0.0, 0.8, 2.0, np.pi, 3.9])
    found = kalman_filter(system, C, W, V, tol=1e-10)

    def rate(t, P):
        A = at(system.A, t)
        return A @ P + P @ A.T - P @ C.T @ np.linalg.solve(V, C @ P) + W

    P = found.P(stops)
    assert np.abs(integrate(rate, P[0], stops) - P).max() < 1e-7 * np.abs(P).max()


@pytest.mark.parametrize("what", ["B", "R"])
def test_the_gain_follows_jumps_that_nobody_named(what):
    """B R^-1 B' is constant, so X is that of python-control's Riccati equation; the gain jumps as B or R does.

    It was one Fourier series, 15 harmonics of a square wave, and "converged".
    """
    A, b, T = np.diag([0.5, 0.6]), np.array([[1.0], [0.3]]), 2.0
    sign = lambda t: np.where(np.mod(t - 0.1234, T) < 0.7, 1.0, -2.0)[:, None, None]  # noqa: E731
    B = (lambda t: sign(t) * b) if what == "B" else (lambda t: sign(t) ** 2 * b)
    R = (lambda t: sign(t) ** 2) if what == "B" else (lambda t: sign(t) ** 4)
    made = periodic_lqr(fl.PeriodicSystem(A, T, B), np.eye(2), R)
    X = control.lqr(A, b, np.eye(2), np.eye(1))[1]
    t = np.random.default_rng(7).uniform(0, T, 200)
    wanted = np.swapaxes(B(t), 1, 2) @ X / R(t)
    assert np.abs(made.K(t) - wanted).max() <= made.error * np.abs(wanted).max()
    assert made.error < 1e-8
    poles = np.linalg.eigvals(A - b @ b.T @ X).real
    assert np.sort(fl.floquet(made.closed_loop).exponents.real) == pytest.approx(np.sort(poles), abs=1e-7)


def test_the_average_of_coefficients_that_jump_where_nobody_named_it_is_exact():
    A, b = np.array([[0.0, 1.0], [-4.0, -0.4]]), np.array([[0.0], [1.0]])
    jump = lambda t: np.where(np.mod(t - 0.1234, 2.0) < 0.7, 1.0, -0.5)[:, None, None]  # noqa: E731, mean 0.025
    made = averaged_lqr(fl.PeriodicSystem(lambda t: A * jump(t), 2.0, lambda t: b * jump(t)), np.eye(2), np.eye(1))
    wanted = control.lqr(0.025 * A, 0.025 * b, np.eye(2), np.eye(1))[0]
    assert made.K(np.zeros(1))[0] == pytest.approx(wanted, rel=1e-9)


def test_a_gain_that_changes_fast_behind_a_narrow_weight_is_followed():
    """The gain's series stopped at 64 nodes, where 32 had been as bad: 0.9 of the largest gain was missing, and the status "converged"."""

    Q = lambda t: np.eye(2) * (1 + np.exp(-(((np.mod(t, 2) - 0.6246) / 6e-3) ** 2)) / 3e-3)[:, None, None]  # noqa: E731
    plant = fl.PeriodicSystem(np.array([[0.0, 1.0], [-4.0, -0.4]]), 2.0, np.array([[0.0], [1.0]]))
    made, t = periodic_lqr(plant, Q, [[0.01]]), np.random.default_rng(3).uniform(0, 2, 2000)
    wanted = np.swapaxes(plant.B(t), 1, 2) @ made.solution.X(t) / 0.01
    assert np.abs(made.K(t) - wanted).max() <= made.error * np.abs(wanted).max()
    assert made.error < 1e-9


def test_unstable_loop_costs_without_end():
    weak = fl.control.pd_feedback(pendulums(damping=-0.05), [0], [0.0], [0.0], problem=DESIGNS[0].problem)
    assert fl.floquet(weak.closed_loop).verdict == "unstable"
    assert weak.cost(np.ones(4)) == np.inf


def test_frozen_schedule_converges_with_the_phases():
    errors = [frozen_lqr(pendulums(), Q, R, phases=k).error for k in (8, 16, 32)]
    assert errors[0] > 8 * errors[1] > 64 * errors[2]


@pytest.mark.parametrize("effort", [1.0, 1e-10])
def test_the_error_of_a_finite_horizon_is_that_of_its_gain(effort):
    """It was X's, 4e-11, beside a gain known to 4e-6 and the word "converged"."""
    plant = fl.PeriodicSystem(np.array([[0.0, 1.0], [-1.0, -0.1]]), 2.0, np.array([[0.0], [1.0]]))
    made = finite_horizon_lqr(plant, np.eye(2), [[effort]])
    assert made.error >= made.solution.gain_error
    assert (made.status == "converged") == (made.error <= 1e-9)


def test_periodic_gain_is_the_limit_of_long_horizons():
    end = periodic_lqr(pendulums(), Q, R)
    made = finite_horizon_lqr(pendulums(), Q, R, end=end.X(np.zeros(1))[0])
    t = np.linspace(0, 3.1, 9)
    assert np.abs(made.K(t) - end.K(t)).max() < 1e-8


@pytest.mark.parametrize("kind", ["frozen-lqr", "averaged-lqr"])
def test_blocked_modes_are_named(kind):
    A = np.diag([0.5, -1.0, 0.25])
    unreached = fl.PeriodicSystem(A, 1.0, np.array([[1.0], [1.0], [0.0]]))
    with pytest.raises(NotStabilizable, match=r"0\.25"):
        design(unreached, table(kind, state_weight=(1, 1, 1)))
    unseen = fl.PeriodicSystem(A, 1.0, np.ones((3, 1)))
    with pytest.raises(NotDetectable, match=r"0\.5"):
        design(unseen, table(kind, state_weight=(0, 1, 1)))
    words = r"not seen by the measurement; got real part of its exponent about 0\.5"
    with pytest.raises(NotDetectable, match=words):
        kalman_filter(unseen, np.array([[0.0, 1.0, 0.0]]), np.eye(3), np.eye(1))
    with pytest.raises(ArgumentError, match="C does not fit"):
        kalman_filter(unseen, np.ones((1, 4)), np.eye(3), np.eye(1))


def test_modes_far_faster_hide_no_mode_that_the_input_reaches():
    """Beside bending at 2e8 rad/s the rank of Hautus's pencil is rounding; the joint is driven all the same."""
    plant = opened(changes={"links.0.bending_stiffness": 3.69e12})[1]
    found = frozen_lqr(plant, np.diag([100.0, 100, 100, 1, 1, 1]), 0.1)
    assert fl.floquet(found.closed_loop).verdict == "stable"


def test_bad_tables_are_refused():
    for changes, message in (
        ({"kind": "magic"}, "no such kind"),
        ({"state_weight": (1, 1, 1)}, "state_weight has the wrong length"),
        ({"input_weight": (0.0,)}, "R is not positive definite"),
        ({"state_weight": (1, 1, -1, 1)}, "Q is indefinite"),
    ):
        with pytest.raises(ArgumentError, match=message):
            design(pendulums(), table(**({"kind": "periodic-lqr"} | changes)))


A0 = np.array([[0.0, 1.0, 0.0], [-1.0, -0.1, 0.5], [0.2, 0.0, -0.3]])
B0, C0 = np.array([[0.0], [1.0], [0.2]]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.3]])
Q0, R0 = np.diag([3.0, 1.0, 2.0]), np.array([[0.2]])


def best_gain():
    def cost(k):
        K = k.reshape(1, 2)
        loop = A0 - B0 @ K @ C0
        if np.linalg.eigvals(loop).real.max() >= 0:
            return 1e9
        return np.trace(solve_continuous_lyapunov(loop.T, -(Q0 + C0.T @ K.T @ R0 @ K @ C0)))

    found = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 2000})
    return found.x, found.fun


@pytest.mark.parametrize("turning", thin([False, True]))
def test_a_plant_gets_the_gain_that_a_search_finds_in_turning_coordinates_too(turning):
    (system, C), P = turned(A0, B0, C0), turn(3, 2.0)
    if turning:
        made = fl.output_lqr(system, C, lambda t: P(t) @ Q0 @ np.swapaxes(P(t), 1, 2), R0)
    else:
        made = fl.output_lqr(fl.PeriodicSystem(A0, 1.0, B=B0), C0, Q0, R0)
    assert fl.floquet(made.closed_loop).verdict == "stable"
    K, cost = best_gain()
    np.testing.assert_allclose(made.K[0], K, rtol=1e-4)
    assert made.cost == pytest.approx(cost, rel=1e-8)
    assert made.status.startswith("converged")


@pytest.mark.slow
def test_an_unstable_plant_begins_at_a_state_feedback_or_is_refused():
    system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    made = fl.output_lqr(system, np.eye(2), np.eye(2), np.eye(1))
    np.testing.assert_allclose(made.K, [[1.0, np.sqrt(3.0)]], rtol=1e-5)
    with pytest.raises(NotStabilizable, match="rates beside angles"):
        fl.output_lqr(system, [[1.0, 0.0]], np.eye(2), np.eye(1))
    with pytest.raises(ArgumentError, match="C does not fit"):
        fl.output_lqr(system, [[1.0]], np.eye(2), np.eye(1))


def test_a_sensor_that_tells_nothing_new_changes_nothing():
    """Dead, or twice the same: the gains of both together are those of the one."""
    system = fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0, B=[[0.0], [1.0]])
    outputs = ([[0.0, 1.0]], [[0.0, 1.0], [0.0, 0.0]], [[0.0, 1.0], [0.0, 1.0]])
    alone, dead, twice = (fl.output_lqr(system, C, np.eye(2), np.eye(1)).K[0] for C in outputs)
    np.testing.assert_allclose(dead, [alone[0], 0.0], atol=1e-9)
    np.testing.assert_allclose(twice, [alone[0] / 2] * 2, rtol=1e-6)
