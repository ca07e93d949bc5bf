"""Errors of Riccati and Lyapunov equations: solutions that are made up first, and backward integration by SciPy."""

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
from tests.periodic.dense import at, integrate
from tests.periodic.systems import random_waves


def flip(M):
    return np.swapaxes(M, -1, -2)


def made_up(seed):
    """X(t) > 0 is chosen with A, B, R in random units; Q(t) follows, and A is shifted until Q > 0: so X is the stabilising one."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    m, T = int(rng.integers(1, n + 1)), 10 ** rng.uniform(-2, 3)
    harmonics, decay, units = int(rng.integers(1, 6)), rng.uniform(0.1, 0.5), 10 ** rng.uniform(-2, 2, n)
    fast, R = 2 * np.pi / T * 10 ** rng.uniform(-1, 2.5), 10 ** rng.uniform(-2, 4)
    (root, root_rate), (A0, _), (B0, _) = (random_waves(rng, n, k, harmonics, decay, T) for k in (n, n, m))

    def X(t):
        L = 1.5 * np.eye(n) + 0.5 * root(t)
        return (L @ flip(L) + 0.3 * np.eye(n)) / np.outer(units, units)

    def B(t):
        return np.sqrt(fast) * units[:, None] * B0(t)

    def weight(t, shift):
        rate = 0.5 * root_rate(t) @ flip(1.5 * np.eye(n) + 0.5 * root(t)) / np.outer(units, units)
        pull = X(t) @ B(t)
        half = 0.5 * pull @ flip(pull) / R - rate - X(t) @ A(t, shift)
        return half + flip(half)

    def A(t, shift):
        return fast * A0(t) * (units[:, None] / units) - shift * np.eye(n)

    t = T * np.arange(2000) / 2000
    inverse = np.linalg.inv(np.linalg.cholesky(X(t) * np.outer(units, units)))
    least = np.linalg.eigvalsh(inverse @ (weight(t, 0.0) * np.outer(units, units)) @ flip(inverse)).min()
    shift = -0.5 * least + fast * 10 ** rng.uniform(-4, 0)
    return PeriodicSystem(lambda t: A(t, shift), T, B), lambda t: weight(t, shift), R * np.eye(m), X


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 5, 8, 11, 14, 17, 21, 25])
def test_errors_of_made_up_solutions_are_covered(seed):
    system, Q, R, X = made_up(seed)
    t = np.random.default_rng(seed).uniform(0, system.period, 400)
    for tol in (1e-4, 1e-7, 1e-9):
        found = periodic_riccati(system, Q, R, tol=tol)
        exact = X(t)
        gain = found.problem.gain(t, exact)
        assert np.abs(found.X(t) - exact).max() <= found.error * np.abs(exact).max()
        assert np.abs(found.K(t) - gain).max() <= found.gain_error * np.abs(gain).max()
        assert found.error <= tol


def test_nothing_to_weigh_gives_zero():
    system = PeriodicSystem(lambda t: -(2 + np.sin(t))[:, None, None] * np.eye(2), 2 * np.pi)
    assert not periodic_lyapunov(system, np.zeros((2, 2))).X(np.array([0.3, 1.0])).any()


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
    assert found.status == "converged"


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
    assert solution.error <= 1e-10
    assert solution.gain_error <= 1e-9


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


PERIOD, JUMP = 2.0, 0.7
KINDS = ("smooth", "jumps", "unnamed jumps", "semidefinite", "cheap", "fast")
INTEGRATED = 2e-11
"""What DOP853 leaves at rtol 1e-12, relative to the largest entry."""


def waves(rng, rows, columns, size):
    """A random trigonometric polynomial with two harmonics."""
    value, _ = random_waves(rng, rows, columns, 2, 1.0, PERIOD)
    return lambda t: size * value(t)


def oscillators(rng, n):
    """Coupled oscillators, slow to fast, whose stiffness swings, and a force on them that turns."""
    rates = np.array([1.0, rng.uniform(4, 10), 10 ** rng.uniform(1.5, 2.3)])
    swing, force = 0.2 * rates[:, None] * rng.uniform(-1, 1, (3, 3)) * rates, waves(rng, 3, 2, 0.7)

    def A(t):
        values = np.zeros((len(t), 6, 6))
        values[:, :3, 3:], values[:, 3:, 3:] = np.eye(3), -0.1 * np.diag(rates)
        values[:, 3:, :3] = -np.diag(rates**2) - swing * np.cos(np.pi * t)[:, None, None]
        return values

    return A, lambda t: np.pad(force(t), ((0, 0), (3, 0), (0, 0)))


def pose(kind, seed):
    """Random coefficients A, B, Q, R, N as functions of time, of which all but A may jump at 0 and JUMP; and six times."""
    rng, jumps = np.random.default_rng([KINDS.index(kind), seed]), "jumps" in kind
    n, m = (6, 2) if kind == "fast" else (int(rng.integers(2, 9)), int(rng.integers(1, 4)))
    A, B = waves(rng, n, n, 1 / np.sqrt(n)), waves(rng, n, m, 1.0)
    if kind == "fast":
        A, B = oscillators(rng, n)
    shift, effort = rng.uniform(-1.5, 0.5) * np.eye(n) * (kind != "fast"), rng.normal(size=(m, m))
    R = (effort @ effort.T + np.eye(m)) * 10.0 ** (rng.uniform(-3, -1) if kind in ("cheap", "fast") else 0)
    root = waves(rng, n, int(rng.integers(1, n)) if kind == "semidefinite" else n, 0.5)
    least = (0.0 if kind == "semidefinite" else 0.3) * np.eye(n)
    N = 0.1 * rng.normal(size=(n, m)) * (kind in ("smooth", "jumps", "unnamed jumps"))

    def step(t):
        wave = 0.2 * np.sin(np.pi * np.asarray(t)) * (kind == "smooth")
        return (1.0 + wave + (jumps & (np.mod(t, PERIOD) >= JUMP)))[:, None, None]

    parts = {
        "A": lambda t: A(t) + shift,
        "B": lambda t: B(t) * step(t),
        "Q": lambda t: (root(t) @ flip(root(t)) + least) * step(t),
        "R": lambda t: R * step(t),
        "N": lambda t: N * step(t),
    }
    return parts, np.sort(rng.uniform(0, PERIOD, 6))


def solve(parts, tol, breaks=()):
    A, B, *weights = parts.values()
    return periodic_riccati(PeriodicSystem(A, PERIOD, B, breaks), *weights, tol)


def integrate_back(parts, X, times, periods):
    """X at 0 and at the times, backwards from X(T), over so many periods or until it repeats, in units of its own."""
    scale = np.sqrt(np.outer(np.diag(X), np.diag(X)))
    stops = np.unique([0.0, *times, JUMP, PERIOD])[::-1]

    def rate(t, X):
        X = 0.5 * (X + X.T) * scale  # skew parts could grow
        A, B, Q, R, N = (at(part, t) if callable(part) else part for part in parts.values())
        pull = B.T @ X + N.T
        return -(X @ A + A.T @ X + Q - pull.T @ np.linalg.solve(R, pull)) / scale

    X, before = X / scale, np.inf
    for _ in range(periods):
        states = integrate(rate, X, stops)
        moved, X = np.abs(states[-1] - X).max(), states[-1]
        if moved <= 1e-12 or 0.5 * before < moved < INTEGRATED / 4:
            break
        before = moved
    else:
        assert periods < 25, f"X does not repeat: {moved:.1e}"
    return states[::-1][np.isin(stops[::-1], [0.0, *times])] * scale


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "seed"), [(kind, k % 2) for k, kind in enumerate(KINDS)])
def test_errors_are_within_the_claims(kind, seed):
    (parts, t), fast = pose(kind, seed), kind == "fast"
    found = solve(parts, 1e-9 if fast else (1e-5, 1e-8)[seed % 2], (0.0, JUMP) if kind == "jumps" else ())
    start = found.X(np.nextafter(PERIOD, 0.0)) * (1 + 1e-6 * (not fast))
    X, own = integrate_back(parts, start, t, 2 if fast else 25)[1:], INTEGRATED * (5 if fast else 1)
    K = np.linalg.solve(parts["R"](t), flip(parts["B"](t)) @ X + flip(parts["N"](t)))
    assert np.abs(found.X(t) - X).max() <= (found.error + own) * np.abs(X).max()
    assert np.abs(found.K(t) - K).max() <= (found.gain_error + own) * np.abs(K).max()
    assert found.status == "converged"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_each_coefficient_may_be_constant_or_vary(seed):
    """Every two of them in all four ways: X goes into itself over a period."""
    (parts, _), (a, b, c) = pose("smooth", seed), (seed >> np.arange(3)) & 1
    for name, varies in zip("ABQRN", (a, b, c, a ^ b, a ^ c), strict=True):
        if not varies:
            parts[name] = at(parts[name], 0.3)
    found = solve(parts, 1e-9)
    X = integrate_back(parts, found.X(0.0), [], 1)[0]
    assert np.abs(found.X(0.0) - X).max() <= (found.error + 1e-9) * np.abs(X).max()
    assert found.error < 1e-9
