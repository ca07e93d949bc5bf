"""The periodic Riccati equation against exact answers, python-control, SciPy's integrators and its own identities; and why there is no
solution: the mode is not reached at all, or too weakly for numbers of this precision."""

import decimal

import control
import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import NotDetectable, NotStabilizable, NumericalError
from flexlin.periodic import finite_horizon_riccati, periodic_riccati
from flexlin.periodic.system import PeriodicSystem
from tests.closed_arm import opened
from tests.periodic.systems import turn, turned


def test_rotated_example_at_random_times():
    """Johansson, Kagstrom, Shiriaev, Varga (2007): x = P z with a constant problem for z; A = P' P^-1 + P A0 P^-1, B = P B0."""
    A0, B0 = np.array([[1.0, 0.5], [3.0, 5.0]]), np.array([[3.0], [1.0]])
    Z, _, gain = control.care(A0, B0, np.eye(2), np.eye(1))
    t = np.random.default_rng(7).uniform(-10, 10, 500)
    P = turn(2, 2.0)(t)
    found = periodic_riccati(turned(A0, B0, np.eye(2))[0], np.eye(2), np.eye(1), tol=1e-11)
    assert np.abs(found.X(t) - P @ Z @ np.swapaxes(P, 1, 2)).max() < 1e-10
    assert np.abs(found.K(t) - gain @ np.swapaxes(P, 1, 2)).max() < 1e-10
    assert found.status == "converged"
    assert max(found.error, found.gain_error) < 1e-10


@pytest.mark.parametrize("width", [0.0956, 0.11])
def test_what_the_dense_output_leaves_out_is_in_the_error(width):
    """z' = u with weights c^2 and 1 costs c tanh(c (T - t)) z^2; x = p(t) z has a narrow place, and a loose tol few panels about it."""
    horizon, c = 2.0, 0.23

    def p(t):
        s = np.sin(np.pi * (t / horizon - 0.874)) / (np.pi * width)
        v = 1 / (1 + s**2)
        return np.exp(-v), 2 * v**2 * s * np.cos(np.pi * (t / horizon - 0.874)) / (width * horizon)  # p, p' / p

    system = PeriodicSystem(lambda t: p(t)[1][:, None, None], horizon, lambda t: p(t)[0][:, None, None])
    t = np.linspace(0.0, horizon, 1001)
    exact = c * np.tanh(c * (horizon - t)) / p(t)[0] ** 2
    for tol in (1e-4, 1e-5, 1e-6):
        found = finite_horizon_riccati(system, lambda t: (c / p(t)[0])[:, None, None] ** 2, [[1.0]], [[0.0]], tol=tol)
        assert np.abs(found.X(t)[:, 0, 0] - exact).max() <= found.error * exact.max(), tol
        gain = exact * p(t)[0]
        assert np.abs(found.K(t)[:, 0, 0] - gain).max() <= found.gain_error * gain.max(), tol


@pytest.mark.parametrize(("fast", "effort"), [(1e4, 1e-3), (1e3, 1e-4)])
def test_the_layer_at_the_end_of_a_horizon_is_followed(fast, effort):
    """Panels that are not graded towards it give no answer: X leaves its end within 1e-5 of the horizon, beside a fast mode."""
    root = np.sqrt(1 + 1 / effort)
    high, low = effort * (root - 1), -effort * (root + 1)  # both rests of X' = 2 X + X^2 / R - 1
    t = 1 - np.array([1.0, 0.3, 1e-2, 1e-4, 1e-6, 1e-7])
    ratio = (100 - high) / (100 - low) * np.exp(2 * root * (t - 1))
    system = PeriodicSystem(np.diag([-1.0, -fast]), 1.0, [[1.0], [0.0]])
    found = finite_horizon_riccati(system, np.eye(2), [[effort]], np.diag([100.0, 0.0]))
    assert np.abs(found.X(t)[:, 0, 0] - (high - ratio * low) / (1 - ratio)).max() <= 100 * found.error < 1e-7


@pytest.mark.parametrize(("damping", "weight"), [(1e-6, 1.0), (1e-6, 1e8), (1e-6, 1e20), (1e-8, 1e20)])
def test_hardly_damped_loop_converges_in_doublings(damping, weight):
    """The scalar equations of an oscillator's X, solved with 60 digits, lie within the error that is reported."""
    with decimal.localcontext() as digits:
        digits.prec = 60
        R, z = decimal.Decimal(weight), decimal.Decimal(damping)
        x12 = R * ((1 + 1 / R).sqrt() - 1)
        x22 = R * ((4 * z**2 + (1 + 2 * x12) / R).sqrt() - 2 * z)
        x11 = x22 + 2 * z * x12 + x12 * x22 / R
    exact = np.array([[float(x11), float(x12)], [float(x12), float(x22)]])
    system = PeriodicSystem(np.array([[0.0, 1.0], [-1.0, -2 * damping]]), 1.0, np.array([[0.0], [1.0]]))
    found = periodic_riccati(system, np.eye(2), weight * np.eye(1))
    assert found.doublings < 40
    assert np.abs(found.X(np.array([0.3]))[0] - exact).max() / np.abs(exact).max() < found.error


@pytest.mark.parametrize(
    ("A", "B", "Q", "error", "rate"),
    [
        (np.diag([1.0, 2.0]), [[1.0], [0.0]], np.eye(2), NotStabilizable, 2.0),
        (np.diag([1.0, -2.0]), [[1.0], [1.0]], np.diag([0.0, 1.0]), NotDetectable, 1.0),
        (np.diag([0.0, -2.0]), [[0.0], [1.0]], np.eye(2), NotStabilizable, 0.0),
        (np.diag([0.0, -2.0]), [[1.0], [1.0]], np.diag([0.0, 1.0]), NotDetectable, 0.0),
        (np.diag([1.0, -2.0, 0.7]), [[1.0], [1.0], [0.0]], np.eye(3), NotStabilizable, 0.7),
        (np.diag([1.0, -2.0, 3.0]), [[1.0], [1.0], [0.0]], np.eye(3), NotStabilizable, 3.0),
    ],
)
def test_missing_solution_names_the_mode(A, B, Q, error, rate):
    """Three of them are mixed by similarity and turn: what is not reached is so up to rounding only."""
    plant = PeriodicSystem(A, 1.0, B)
    if len(A) == 3:
        V = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
        plant = turned(V @ A @ V.T, V @ B, np.eye(3), 1.0)[0]
    with pytest.raises(error, match=r"real part of its exponent about") as caught:
        periodic_riccati(plant, Q, np.eye(1))
    named = float(str(caught.value).split("about ")[1].split("/s")[0])
    assert abs(named - rate) < 0.05 + 0.05 * rate


def test_constant_systems_are_lqr_with_cross_term_and_modes_that_overflow():
    rng = np.random.default_rng(3)
    A, B, N = rng.normal(size=(5, 5)), rng.normal(size=(5, 2)), 0.1 * rng.normal(size=(5, 2))
    V = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    fast, t = V @ np.diag([200.0, -200.0, 150.0, 0.0, 1.0]) @ V.T, np.array([0.0, 0.123, 0.5])
    every, some = np.eye(5), np.diag([1.0, 1.0, 0.0, 0.0, 0.0])
    for matrix, Q, cross, within in ((A, every, N, 1e-10), (A, some, 0 * N, 1e-10), (fast, every, 0 * N, 1e-9)):
        K, X, _ = control.lqr(matrix, B, Q, 0.3 * np.eye(2), cross)
        found = periodic_riccati(PeriodicSystem(matrix, 0.8, B), Q, 0.3 * np.eye(2), cross, tol=1e-11)
        assert np.abs(found.X(t) - X).max() < within * np.abs(X).max()
        assert np.abs(found.K(t) - K).max() < within * np.abs(K).max()


OSCILLATOR = np.array([[0.0, 1.0], [-1.0, -0.1]])
FORCED = np.array([[0.0], [1.0]])


@pytest.mark.slow
@pytest.mark.parametrize("swing", [0.0, 0.3])
def test_weights_that_lie_too_far_apart_are_not_said_to_hide_a_mode(swing):
    """Every mode is reached, seen and excited as well as can be: the weight of the input alone is in the way, or the sensor's noise."""

    def swinging(t):
        return OSCILLATOR * (1 + swing * np.cos(2 * np.pi * t))[:, None, None]

    plant = PeriodicSystem(swinging, 1.0, FORCED)
    for design, words in (
        (lambda: fl.periodic_lqr(plant, np.eye(2), [[1e-100]]), r"\|B R\^-1 B'\| = 1e\+100"),
        (lambda: fl.control.kalman_filter(plant, [[1.0, 0.0]], np.eye(2), [[1e-100]]), "lie too far apart"),
    ):
        with pytest.raises(NumericalError, match=words) as caught:
            design()
        assert "lie too far apart" in str(caught.value)
        assert "excited" not in str(caught.value)
        assert not isinstance(caught.value, NotDetectable | NotStabilizable)


@pytest.mark.parametrize("effort", [1e-8, 1e-20, 1e-30])
def test_an_input_that_costs_next_to_nothing_has_an_honest_gain(effort):
    """X = [[1, r], [r, r]] and K = [1, 1] / r for small r = sqrt(R), to first order in r."""
    design, r = fl.periodic_lqr(PeriodicSystem(OSCILLATOR, 1.0, FORCED), np.eye(2), [[effort]]), np.sqrt(effort)
    assert design.error < 0.1
    assert np.abs(design.K(0.3) * r - 1).max() <= design.error + 2 * r
    assert np.abs(design.X(0.3) - [[1, r], [r, r]]).max() <= design.solution.error + 2 * r


def test_a_stiff_damped_link_is_reached_at_every_frozen_phase():
    """A link a million times stiffer moves as a rigid one: its slowest gain is that of the rigid arm, whose design must exist too."""
    gains = []
    for changes in ({"links.0.modes": 2, "links.0.bending_stiffness": 3.6866e6}, {"links.0.modes": 0}):
        lin = opened(changes=changes)[1]
        weight = np.full(2 * lin.n, 1e-3)
        weight[[0, lin.n]] += 100.0, 1.0
        made = fl.control.frozen_lqr(lin.periodic_system(), np.diag(weight), [[0.1]])
        gains.append(made.K(np.zeros(1))[0][:, [0, lin.n]])
    assert gains[0] == pytest.approx(gains[1], rel=1e-3)
