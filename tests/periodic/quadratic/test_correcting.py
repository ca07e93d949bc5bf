"""Periodic Riccati equations with fast modes: corrected series against integration by SciPy, which shares nothing with them."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.periodic import FourierNodes, LoopLyapunov, gauss_transitions, linear_quadratic, periodic_riccati
from studies import scaling
from tests.thinned import thin

T = 2.0


def draw(seed: int) -> tuple[fl.PeriodicSystem, np.ndarray, np.ndarray]:
    """Three coupled oscillators, slow to fast, whose stiffness swings, a force that turns; cheap and dear control."""
    g = np.random.default_rng(seed)
    rates = np.array([1.0, g.uniform(4, 10), 10 ** g.uniform(1.5, 2.3)])
    mean, swing = np.diag(rates**2), 0.2 * rates[:, None] * g.uniform(-1, 1, (3, 3)) * rates
    force, turn, phase = g.normal(size=(3, 2)), g.normal(size=(3, 2)), g.uniform(0, 2 * np.pi)

    def A(t: np.ndarray) -> np.ndarray:
        values = np.zeros((len(t), 6, 6))
        values[:, :3, 3:] = np.eye(3)
        values[:, 3:, :3] = -mean - swing * np.cos(2 * np.pi * t / T + phase)[:, None, None]
        values[:, 3:, 3:] = -0.1 * np.diag(rates)
        return values

    def B(t: np.ndarray) -> np.ndarray:
        values = np.zeros((len(t), 6, 2))
        values[:, 3:] = force + turn * np.sin(2 * np.pi * t / T)[:, None, None]
        return values

    Q = np.diag(np.concatenate([g.uniform(0.5, 2, 3), 10 ** g.uniform(-4, 0, 3)]))
    return fl.PeriodicSystem(A, T, B, complete=True), Q, 10 ** g.uniform(-5, 0) * np.eye(2)


def integrate(
    system: fl.PeriodicSystem, Q: np.ndarray, R: np.ndarray, start: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """X at decreasing times, backwards from a cost at the end of the period until it repeats."""
    n, effort = len(Q), np.linalg.inv(R)

    def rate(s: float, x: np.ndarray) -> np.ndarray:
        A, B = system.A(np.array([-s]))[0], system.B(np.array([-s]))[0]
        X = x.reshape(n, n)
        half = X @ A
        return (half + half.T - X @ B @ effort @ B.T @ X + Q).ravel()

    heights = np.sqrt(np.diag(start))
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13 * np.outer(heights, heights).ravel()}
    x = start.ravel()
    for _ in range(30):
        last, x = x, solve_ivp(rate, (-T, 0.0), x, **options).y[:, -1]
        if np.abs(x - last).max() <= 1e-12 * np.abs(x).max():
            break
    return solve_ivp(rate, (-T, -times[-1]), x, t_eval=-times, **options).y.T.reshape(-1, n, n)


@pytest.mark.slow
@pytest.mark.parametrize("seed", thin(range(12), 3))
def test_the_error_and_that_of_the_gain_hold_between_the_nodes(seed: int) -> None:
    system, Q, R = draw(seed)
    problem = linear_quadratic(system, Q, R)
    found = periodic_riccati(system, Q, R)
    assert found.error <= 1e-9
    times = np.sort(T * np.random.default_rng(seed).random(7))[::-1]
    X = integrate(system, Q, R, found.X(0.0), times)
    assert np.abs(found.X(times) - X).max() <= (found.error + 1e-11) * np.abs(X).max()
    K = problem.gain(times, X)
    assert np.abs(found.K(times) - K).max() <= (found.gain_error + 1e-10) * np.abs(K).max()


@pytest.mark.slow
def test_cheap_control_of_a_turning_field_is_no_longer_limited_by_rounding() -> None:
    """A satellite's torques act across the field alone: where control is cheap, segments lost seven digits of the gain."""
    w = 1e-3
    A = np.zeros((6, 6))
    A[:3, 3:], A[3:, :3], A[3, 5], A[5, 3] = np.eye(3), -(w**2) * np.diag([2.0, 1.5, 0.5]), w, -w

    def B(t: np.ndarray) -> np.ndarray:
        values = np.zeros((len(t), 6, 3))
        b = np.stack([np.cos(w * t), np.full(len(t), -0.6), 2 * np.sin(w * t)], axis=1) * 1e-7
        for i, j, sign in ((0, 1, 1), (1, 2, 1), (2, 0, 1), (1, 0, -1), (2, 1, -1), (0, 2, -1)):
            values[:, 3 + i, j] = sign * b[:, 3 - i - j]
        return values

    system = fl.PeriodicSystem(A, 2 * np.pi / w, B, complete=True)
    solution = periodic_riccati(system, np.diag([1.0, 1, 1, 1e6, 1e6, 1e6]), 1e-7 * np.eye(3), tol=1e-10)
    assert solution.error <= 1e-10
    assert solution.gain_error <= 1e-9


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("seed", thin(range(4)))
def test_the_lyapunov_equation_of_a_loop_is_solved_and_better_by_corrections(seed: int, known: bool) -> None:
    """D is given as a series; the right side is what it misses; known: transition matrices are, and corrections are worth far more."""
    system, Q, R = draw(seed)
    found, g = periodic_riccati(system, Q, R), np.random.default_rng(seed)
    nodes = FourierNodes(512, T)
    angle = np.outer(nodes.t, 2 * np.pi / T * np.arange(5))[:, :, None, None]
    heights = np.sqrt(np.diagonal(found.X(nodes.t), axis1=1, axis2=2).max(axis=0))
    waves = g.normal(size=(5, 6, 6)) * np.outer(heights, heights)
    wanted = (np.cos(angle) * (waves + np.swapaxes(waves, 1, 2))).sum(axis=1)
    loop = system.A(nodes.t) - system.B(nodes.t) @ found.K(nodes.t)

    def miss(D: np.ndarray) -> np.ndarray:
        return nodes.slopes(D) + D @ loop + np.swapaxes(D @ loop, 1, 2)

    halves = T / 1024 * np.arange(-1, 1024)
    steps = gauss_transitions(lambda t: system.A(t % T) - system.B(t % T) @ found.K(t % T), halves)
    exact = np.concatenate([steps[0::2], steps[1::2]]) if known else None
    lyapunov, D, sizes = LoopLyapunov(loop, nodes, exact), np.zeros_like(wanted), []
    for _ in range(8):
        more = lyapunov.solve(miss(D) - miss(wanted))
        assert more is not None
        D = D + lyapunov.sharpen(more)
        sizes.append(np.abs((D - wanted) / np.outer(heights, heights)).max())
    assert sizes[0] <= 0.1 * np.abs(waves / np.outer(heights, heights)).max()
    assert sizes[-1] <= (1e-8 if known else 1e-3) * sizes[0]


@pytest.mark.slow
@pytest.mark.parametrize(("Q", "R"), [(1.0, 100.0), (10.0, 0.01)])
def test_a_chain_of_flexible_links_is_solved_by_corrections_whatever_its_weights(Q: float, R: float) -> None:
    """Three links with two modes each: finer nodes are tried where few prove nothing, and where Newton's method settles on many alone."""
    scene = scaling.scene_of(3, 2)
    plant = fl.linearize(fl.build_manipulator(scene), scene.motion)
    loose, tight = (fl.periodic_lqr(plant, Q=Q * np.eye(18), R=R * np.eye(3), tol=tol).solution for tol in (1e-6, 1e-8))
    t = np.linspace(0.0, plant.period, 101)
    K = tight.K(t)
    assert loose.gain_error < 1e-6
    assert np.abs(loose.K(t) - K).max() <= (loose.gain_error + tight.gain_error) * np.abs(K).max()
