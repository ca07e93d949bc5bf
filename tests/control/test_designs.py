"""Every kind of design: costs that agree with integration, optimality, and named refusals."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.control import averaged_lqr, design, finite_horizon_lqr, frozen_lqr, pd_feedback, periodic_lqr
from flexlin.errors import ArgumentError, NotDetectable, NotStabilizable
from flexlin.scene.control import DesignTable
from tests.closed_arm import opened

KINDS = ("periodic-lqr", "frozen-lqr", "averaged-lqr", "finite-horizon-lqr")


def pendulums(depth=0.8, damping=0.02):
    """Two coupled oscillators, one driven, whose stiffness swings through a parametric resonance."""

    def stiffness(t):
        out = np.tile(np.array([[2.0, -0.6], [-0.6, 1.3]]), (len(t), 1, 1))
        out[:, 0, 0] += depth * np.cos(2 * t)
        out[:, 1, 1] += depth * np.sin(2 * t)
        return out

    return fl.PeriodicSystem.from_second_order(
        np.array([[1.5, 0.2], [0.2, 1.0]]), damping * np.eye(2), stiffness, np.pi, np.array([[1.0], [0.0]])
    )


Q, R = np.diag([2.0, 2.0, 1.0, 1.0]), np.array([[0.5]])


def table(kind, **changes):
    content = {"name": "mine", "kind": kind, "phases": 24, "state_weight": np.diag(Q), "input_weight": np.diag(R)}
    return DesignTable.model_construct(**(content | changes))


def integrated_cost(made, x0, periods=40):
    """The integral of x' Q x + u' R u along the closed loop, by SciPy."""

    def rate(t, z):
        at, x = np.array([t]), z[:-1]
        u = -made.K(at)[0] @ x
        return np.append(made.closed_loop.A(at)[0] @ x, x @ Q @ x + u @ R @ u)

    run = solve_ivp(rate, (0, periods * np.pi), np.append(x0, 0.0), "DOP853", rtol=1e-10, atol=1e-12)
    return run.y[-1, -1]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS[:3])
def test_cost_is_the_integral_along_the_loop(kind):
    made = design(pendulums(), table(kind))
    x0 = np.array([0.3, -0.2, 0.1, 0.4])
    assert made.cost(x0) == pytest.approx(integrated_cost(made, x0), rel=1e-7)


@pytest.mark.slow
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4), st.floats(0, 3))
@settings(max_examples=6, deadline=None)
def test_no_design_is_cheaper_than_the_periodic_one(start, t):
    best, *others = DESIGNS
    for other in others:
        assert best.cost(start, t) <= other.cost(start, t) * (1 + 1e-9) + 1e-12


DESIGNS = [
    periodic_lqr(pendulums(), Q, R),
    frozen_lqr(pendulums(), Q, R),
    averaged_lqr(pendulums(), Q, R),
    pd_feedback(pendulums(), [0], [3.0], [2.0], problem=periodic_lqr(pendulums(), Q, R).problem),
]


def test_constant_system_gives_the_lqr_of_python_control_in_every_kind():
    system = pendulums(depth=0.0)
    A, B = system.A(np.zeros(1))[0], system.B(np.zeros(1))[0]
    K, X, poles = control.lqr(A, B, Q, R)
    for kind in KINDS:
        made = design(system, table(kind))
        assert (made.name, made.kind) == ("mine", kind)
        assert np.abs(made.K(np.array([0.0, 0.7, 2.0])) - K).max() < 1e-8
        assert np.abs(made.X(np.array([0.7])) - X).max() < 1e-8 * np.abs(X).max()
        real = np.sort(fl.floquet(made.closed_loop).exponents.real)
        assert np.abs(real - np.sort(poles.real)).max() < 1e-7


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

    def Q(t):
        return np.eye(2) * (1 + np.exp(-(((np.mod(t, 2.0) - 0.6246) / 6e-3) ** 2)) / 3e-3)[:, None, None]

    plant = fl.PeriodicSystem(np.array([[0.0, 1.0], [-4.0, -0.4]]), 2.0, np.array([[0.0], [1.0]]))
    made, t = periodic_lqr(plant, Q, [[0.01]]), np.random.default_rng(3).uniform(0, 2, 2000)
    wanted = np.swapaxes(plant.B(t), 1, 2) @ made.solution.X(t) / 0.01
    assert np.abs(made.K(t) - wanted).max() <= made.error * np.abs(wanted).max()
    assert made.error < 1e-9


def test_unstable_loop_costs_without_end():
    weak = pd_feedback(pendulums(damping=-0.05), [0], [0.0], [0.0], problem=DESIGNS[0].problem)
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


@pytest.mark.parametrize("kind", ["frozen-lqr", "averaged-lqr", "periodic-lqr"])
def test_blocked_modes_are_named(kind):
    A = np.diag([0.5, -1.0, 0.25])
    unreached = fl.PeriodicSystem(A, 1.0, np.array([[1.0], [1.0], [0.0]]))
    with pytest.raises(NotStabilizable, match=r"0\.25"):
        design(unreached, table(kind, state_weight=(1, 1, 1)))
    unseen = fl.PeriodicSystem(A, 1.0, np.ones((3, 1)))
    with pytest.raises(NotDetectable, match=r"0\.5"):
        design(unseen, table(kind, state_weight=(0, 1, 1)))


def test_modes_far_faster_hide_no_mode_that_the_input_reaches():
    """Beside bending at 2e8 rad/s the rank of Hautus's pencil is rounding; the joint is driven all the same."""
    _, plant = opened(changes={"links.0.bending_stiffness": 3.69e12})
    found = frozen_lqr(plant, np.diag([100.0, 100, 100, 1, 1, 1]), 0.1)
    assert fl.floquet(found.closed_loop).verdict == "stable"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "magic"}, "no such kind"),
        ({"state_weight": (1, 1, 1)}, "state_weight has the wrong length"),
        ({"input_weight": (0.0,)}, "R is not positive definite"),
        ({"state_weight": (1, 1, -1, 1)}, "Q is indefinite"),
    ],
)
def test_bad_tables_are_refused(changes, message):
    with pytest.raises(ArgumentError, match=message):
        design(pendulums(), table(**({"kind": "periodic-lqr"} | changes)))
