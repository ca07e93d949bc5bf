"""Errors of Riccati and Lyapunov equations: of solutions that are made up first."""

from functools import partial

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov
from scipy.special import erf

import flexlin as fl
from flexlin import PeriodicSystem, periodic_lyapunov
from flexlin.errors import NotStable
from flexlin.periodic import periodic_riccati
from flexlin.periodic.riccati.nodes import FourierNodes
from studies import scaling
from tests.periodic.dense import at
from tests.periodic.systems import random_waves


def flip(M):
    return np.swapaxes(M, -1, -2)


def made_up(seed):
    """X(t) > 0 is chosen with A, B, R, N in random units, of which the seed's bits say which vary and its rest by 3 whether B, N, R jump,
    named or not; Q(t) follows, and A is shifted until Q > N R^-1 N': so X is the stabilising one."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    m, T = int(rng.integers(1, n + 1)), 10 ** rng.uniform(-2, 3)
    harmonics, decay, units = int(rng.integers(1, 6)), rng.uniform(0.1, 0.5), 10 ** rng.uniform(-2, 2, (n, 1))
    fast = 2 * np.pi / T * 10 ** rng.uniform(-1, 0.5 if seed % 3 else 2.5)
    effort = 10 ** rng.uniform(-1 if seed % 3 else -3, 4)
    (root, root_rate), *others = (random_waves(rng, n, k, harmonics, decay, T) for k in (n, n, m, m))
    A0, B0, N0 = (value for value, _ in others)
    varies, place = (seed >> np.arange(4)) & 1, rng.uniform(0, T)

    def step(t):
        return (1.0 + (seed % 3 > 0) * (np.mod(t, T) >= place))[:, None, None]

    def X(t):
        L = 1.5 * np.eye(n) + 0.5 * root(t)
        return (L @ flip(L) + 0.3 * np.eye(n)) / (units * units.T)

    def Q(t, shift):
        rate = 0.5 * root_rate(t) @ flip(1.5 * np.eye(n) + 0.5 * root(t)) / (units * units.T)
        pull = X(t) @ B(t) + N(t)
        half = 0.5 * pull @ np.linalg.solve(R(t), flip(pull)) - rate - X(t) @ A(t, shift)
        return half + flip(half)

    def A(t, shift):
        return fast * A0(varies[0] * t) * (units / units.T) - shift * np.eye(n)

    def B(t):
        return step(t) * np.sqrt(fast) * units * B0(varies[1] * t)

    def R(t):
        return step(t) * effort * np.exp(varies[2] * np.sin(2 * np.pi * t / T))[:, None, None] * np.eye(m)

    def N(t):
        return step(t) * 0.1 * np.sqrt(fast * effort) * N0(varies[3] * t) / units

    t = T * np.arange(2000) / 2000
    inverse = np.linalg.inv(np.linalg.cholesky(X(t) * (units * units.T)))
    left = (Q(t, 0.0) - N(t) @ np.linalg.solve(R(t), flip(N(t)))) * (units * units.T)
    shift = -0.5 * np.linalg.eigvalsh(inverse @ left @ flip(inverse)).min() + fast * 10 ** rng.uniform(-4, 0)
    given = (partial(A, shift=shift), B, partial(Q, shift=shift), R, N)
    waves = (varies[0], *(seed % 3 + one for one in (varies[1], 1, *varies[2:])))
    first, second, *weights = (part if waving else at(part, 0.0) for part, waving in zip(given, waves, strict=True))
    return PeriodicSystem(first, T, second, (0.0, place) if seed % 3 == 1 else ()), weights, X


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_errors_of_made_up_solutions_are_covered(seed):
    system, weights, X = made_up(seed)
    t = np.random.default_rng(seed).uniform(0, system.period, 400)
    for tol in (1e-4, 1e-7, 1e-9):
        found = periodic_riccati(system, *weights, tol=tol)
        exact = X(t)
        gain = found.problem.gain(t, exact)
        assert np.abs(found.X(t) - exact).max() <= found.error * np.abs(exact).max()
        assert np.abs(found.K(t) - gain).max() <= found.gain_error * np.abs(gain).max()
        assert found.error <= tol


def test_a_residual_is_largest_anywhere_between_nodes():
    """Where the loop is fast X is as wrong as its residual at that time: looked at half-way between nodes alone it was missed."""
    fast = PeriodicSystem(
        lambda t: 3 * np.cos(4 * t + 0.47)[:, None, None],
        2 * np.pi,
        lambda t: 1 + 0.5 * np.sin(t + 3.29)[:, None, None],
    )
    loose, tight = (periodic_riccati(fast, [[1.0]], [[1e-8]], tol=tol) for tol in (1e-8, 1e-13))
    t = np.linspace(0.0, 7.0, 3000)
    assert np.abs(loose.X(t) - tight.X(t)).max() <= (loose.error + tight.error) * tight.X(t).max()


@pytest.mark.parametrize("damping", [1e-1, 1e-6])
def test_any_symmetric_right_side_of_lyapunovs_equation(damping):
    """X(t) is made up, and Q = -X' - A' X - X A, which is indefinite: also where modes hardly decay."""
    J, wave = np.array([[-damping, 3.0], [-3.0, -damping]]), np.array([[1.0, 2.0], [2.0, 0.0]])

    def A(t):
        return J + np.cos(t)[:, None, None] * np.array([[0.0, 1.0], [-1.0, 0.0]])

    def X(t):
        return np.diag([1.0, -2.0]) + np.cos(t)[:, None, None] * wave + np.sin(2 * t)[:, None, None] * np.eye(2)

    def Q(t):
        rate = -np.sin(t)[:, None, None] * wave + 2 * np.cos(2 * t)[:, None, None] * np.eye(2)
        return -rate - X(t) @ A(t) - flip(X(t) @ A(t))

    found = periodic_lyapunov(PeriodicSystem(A, 2 * np.pi), Q)
    t = np.random.default_rng(2).uniform(0, 7, 100)
    assert np.abs(found.X(t) - X(t)).max() <= found.error * np.abs(X(t)).max() < 1e-6


def test_lyapunovs_equation_with_jumps_and_a_mode_that_hardly_decays():
    """x' = a(t) x with a = -1 + 1e-7 for half of the period, then 1: X over a whole period by its closed form."""
    rates = 1.0 - 4e-7, -1 + 1e-7

    def a(t):
        return np.where(np.mod(t, 2.0) < 1.0, *rates)[:, None, None]

    found = periodic_lyapunov(PeriodicSystem(a, 2.0, breaks=(0.0, 1.0)), [[1.0]])
    parts = [np.expm1(2 * r) / (2 * r) for r in rates]
    exact = (parts[0] + np.exp(2 * rates[0]) * parts[1]) / -np.expm1(2 * sum(rates))
    assert abs(found.X(0.0).item() - exact) <= found.error * np.abs(found.X(np.linspace(0, 2, 50))).max()
    assert found.error < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_claims_beside_steps_pulses_and_jumps_are_sharp(seed):
    """A = P' P^-1 + P J P^-1 and Q = P^-T P^-1 have X = P^-T Y P^-1, J' Y + Y J + I = 0; P = I + f N, f a step of an error function less a
    saw (a pulse in A), a triangle (jumps), or both."""
    rng = np.random.default_rng([seed, 11])
    T, place, width = rng.uniform(0.3, 5.0), rng.uniform(0.1, 0.4), 10 ** rng.uniform(-4, -2.5)
    a, decay = rng.standard_normal(2), 10 ** rng.uniform(-1, 0.5, 2)
    N, J = np.outer(a, [-a[1], a[0]]) / (a @ a), np.array([[-decay[0], 3.0], [0.0, -decay[1]]])
    Y = solve_continuous_lyapunov(J.T, -np.eye(2))

    def P(t, sign):
        apart = np.mod(t / T - place + 0.5, 1.0) - 0.5
        f = (seed % 3 != 1) * (erf(apart / width) / 2 - apart) + (seed % 3 != 0) * np.abs(apart)
        return np.eye(2) + sign * f[:, None, None] * N

    def A(t):
        apart = np.mod(t / T - place + 0.5, 1.0) - 0.5
        rate = (seed % 3 != 1) * (np.exp(-((apart / width) ** 2)) / (width * np.sqrt(np.pi)) - 1)
        rate += (seed % 3 != 0) * np.sign(apart)
        return rate[:, None, None] / T * N @ P(t, -1) + P(t, 1) @ J @ P(t, -1)

    found = periodic_lyapunov(PeriodicSystem(A, T), lambda t: flip(P(t, -1)) @ P(t, -1))
    t = T * np.append(rng.uniform(0, 1, 200), place + width * rng.uniform(-3, 3, 100))
    exact = flip(P(t, -1)) @ Y @ P(t, -1)
    assert np.abs(found.X(t) - exact).max() <= found.error * np.abs(exact).max()
    assert found.error <= 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.1, 0.0])
def test_an_unstable_system_has_no_lyapunov_matrix(rate):
    with pytest.raises(NotStable, match="expected a stable system"):
        periodic_lyapunov(PeriodicSystem(lambda t: (rate + np.cos(t))[:, None, None], 2 * np.pi), [[1.0]])


@pytest.mark.slow
def test_cheap_control_of_a_turning_field_is_no_longer_limited_by_rounding():
    """A satellite's torques act across the field alone: where control is cheap, segments lost seven digits of the gain."""
    w = 1e-3
    A = np.zeros((6, 6))
    A[:3, 3:], A[3:, :3], A[3, 5], A[5, 3] = np.eye(3), -(w**2) * np.diag([2.0, 1.5, 0.5]), w, -w

    def B(t):
        b = np.stack([np.cos(w * t), np.full(len(t), -0.6), 2 * np.sin(w * t)], axis=1) * 1e-7
        return np.pad(np.cross(b[:, None], np.eye(3)), ((0, 0), (3, 0), (0, 0)))

    system = PeriodicSystem(A, 2 * np.pi / w, B, complete=True)
    solution = periodic_riccati(system, np.diag([1.0, 1, 1, 1e6, 1e6, 1e6]), 1e-7 * np.eye(3), tol=1e-10)
    assert max(solution.error, solution.gain_error / 10) <= 1e-10


@pytest.mark.slow
@pytest.mark.parametrize(("Q", "R"), [(1.0, 100.0), (10.0, 0.01)])
def test_a_chain_of_flexible_links_is_solved_by_corrections_whatever_its_weights(Q, R):
    """Three links with two modes each: finer nodes are tried where few prove nothing, and where Newton's method settles on many alone."""
    scene = scaling.scene_of(3, 2)
    plant = fl.linearize(fl.build_manipulator(scene), scene.motion)
    loose, tight = (fl.periodic_lqr(plant, Q=Q * np.eye(18), R=R * np.eye(3), tol=tol).solution for tol in (1e-6, 1e-8))
    t = np.linspace(0.0, plant.period, 101)
    K = tight.K(t)
    assert loose.gain_error < 1e-6
    assert np.abs(loose.K(t) - K).max() <= (loose.gain_error + tight.gain_error) * np.abs(K).max()


def test_small_entries_of_the_cost_keep_their_waves():
    """A fast mode's rate costs 1e-9 of its angle: waves that were cut below the largest entry's rounding took digits of the gain."""
    nodes = FourierNodes(64, 2.0)
    X = np.tile(np.diag([1.0, 1e-9]), (64, 1, 1))
    X[:, 1, 1] *= 1 + 1e-7 * np.cos(5 * np.pi * nodes.t)
    assert np.abs(nodes.series(X)(nodes.t)[:, [0, 1], [0, 1]] / X[:, [0, 1], [0, 1]] - 1).max() < 1e-14
