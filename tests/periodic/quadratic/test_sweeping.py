"""The sweeps of sweeping.py against SciPy's integration of random problems; claims held to their word, hostile problems declined."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flexlin as fl
from flexlin.compiler import find_compiler
from flexlin.periodic.quadratic.backward import find_sweeps
from flexlin.periodic.quadratic.linear_quadratic import linear_quadratic
from flexlin.periodic.quadratic.resolution import resolve_problem
from flexlin.periodic.quadratic.riccati import periodic_riccati
from flexlin.periodic.quadratic.running_cost import judge_by_cost
from flexlin.periodic.quadratic.samples import RiccatiSampler
from flexlin.periodic.quadratic.sweeping import solve_by_sweeps

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")


def waves(rng, rows, columns, size, harmonics=2):
    """A random smooth matrix function of the phase, and its evaluation at times of period 2 s."""
    parts = size * rng.standard_normal((2 * harmonics + 1, rows, columns))

    def function(t):
        k = np.arange(1, harmonics + 1)
        phase = np.pi * np.multiply.outer(t, k)
        return np.tensordot(np.concatenate([np.ones((len(t), 1)), np.cos(phase), np.sin(phase)], axis=1), parts, 1)

    return function


def random_problem(seed):
    """A plant of 1 to 7 states in random units, stable or not, with 1 or 2 inputs; weights that vary or not, with a cross term or not."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 8)), int(rng.integers(1, 3))
    units = 10.0 ** rng.uniform(-2, 2, n)
    A, B = waves(rng, n, n, 0.6), waves(rng, n, m, 1.0)
    drift = rng.uniform(-1.5, 0.8)
    system = fl.PeriodicSystem(
        lambda t: units[:, None] * (A(t) + drift * np.eye(n)) / units, 2.0, lambda t: units[:, None] * B(t)
    )
    root, effort = waves(rng, n, n, 0.5), rng.standard_normal((m, m))
    cross = 0.1 * rng.standard_normal((n, m)) if seed % 2 else np.zeros((n, m))

    def Q(t):
        half = root(t) if seed % 3 else root(np.zeros(1))
        return (half @ np.swapaxes(half, 1, 2) + 0.3 * np.eye(n) + np.zeros((len(t), 1, 1))) / np.outer(units, units)

    return system, Q, effort @ effort.T + np.eye(m), cross / units[:, None]


def integrated(system, Q, R, N, t, rate):
    """X(t) of SciPy's DOP853, backwards from nothing until the start is forgotten."""
    n, effort, T = system.n, np.linalg.inv(R), system.period

    def slope(s, x):
        at, X = np.array([-s]), 0.5 * (x.reshape(n, n) + x.reshape(n, n).T)
        A, B = system.A(at)[0], system.B(at)[0]
        pull = X @ B + N
        return (A.T @ X + X @ A - pull @ effort @ pull.T + Q(at)[0]).ravel()

    begin = T * np.ceil(17 / (rate * T)) + T
    run = solve_ivp(slope, (-begin, -t[0]), np.zeros(n * n), "DOP853", -t[::-1], rtol=1e-12, atol=1e-13)
    return run.y.T[::-1].reshape(-1, n, n)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3, 5])
def test_claims_cover_the_true_errors(seed):
    system, Q, R, N = random_problem(seed)
    problem, _ = resolve_problem(linear_quadratic(system, Q, R, N), system)
    t, every, truth = np.array([0.0, 0.31, 1.17, 1.93]), np.linspace(0, 2, 64), None
    for tol in (1e-5, 3e-10):
        found = solve_by_sweeps(problem, 2.0, tol)
        assert found is not None
        assert found.error <= tol
        if truth is None:
            truth = integrated(system, Q, R, N, t, -fl.floquet(system.feedback(found.K)).exponents.real.max())
        assert np.abs(found.X(t) - truth).max() <= (found.error + 1e-11) * np.abs(found.X(every)).max()
        K = np.linalg.solve(R, np.swapaxes(system.B(t), 1, 2) @ truth + N.T)
        assert np.abs(found.K(t) - K).max() <= (found.gain_error + 1e-10) * np.abs(found.K(every)).max()


def test_every_solution_agrees_with_the_doubled_one(monkeypatch):
    """Ten more random problems, against the route that knows nothing of sweeps."""
    for seed in range(100, 110):
        system, Q, R, N = random_problem(seed)
        swept = periodic_riccati(system, Q, R, N, tol=1e-8)
        monkeypatch.setattr("flexlin.periodic.quadratic.riccati.solve_by_sweeps", lambda *_: None)
        other = periodic_riccati(system, Q, R, N, tol=1e-11)
        monkeypatch.undo()
        t = np.linspace(0, 2, 37)
        X = other.X(t)
        assert np.abs(swept.X(t) - X).max() <= (swept.error + other.error) * np.abs(X).max()


def test_a_weight_that_misses_states_is_proved_by_what_the_loop_makes_of_the_residual(monkeypatch):
    """Position weighed alone, one input: the running cost is singular at all times."""
    A = [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.3, 0.0], [0.0, 0.0, 0.0, 1.0], [0.3, 0.0, -2.0, 0.0]]
    system = fl.PeriodicSystem(A, 2.0, lambda t: np.outer(1.5 + np.sin(np.pi * t), [0.0, 1.0, 0.0, 0.4])[:, :, None])
    Q = np.diag([1.0, 0.0, 0.5, 0.0])
    problem, _ = resolve_problem(linear_quadratic(system, Q, 1.0), system)
    found = [solve_by_sweeps(problem, 2.0, tol) for tol in (1e-4, 1e-9)]
    assert all(one is not None for one in found)
    monkeypatch.setattr("flexlin.periodic.quadratic.riccati.solve_by_sweeps", lambda *_: None)
    other, t = periodic_riccati(system, Q, 1.0, tol=1e-11), np.linspace(0, 2, 37)
    for one in found:
        for values, right, error in (
            (one.X(t), other.X(t), one.error + other.error),
            (one.K(t), other.K(t), one.gain_error + other.gain_error),
        ):
            assert np.abs(values - right).max() <= error * np.abs(right).max()


def test_a_loop_that_forgets_slowly_is_closed():
    """Without damping, and with a weight so small that a period leaves 0.99 of the state."""
    A = [[0.0, 1.0], [-1.0, 0.0]]
    system = fl.PeriodicSystem(A, 2 * np.pi, lambda t: np.array([[0.0], [1.0]]) * (1 + 0.5 * np.cos(t))[:, None, None])
    problem, _ = resolve_problem(linear_quadratic(system, 1e-5 * np.eye(2), 1.0), system)
    found = solve_by_sweeps(problem, 2 * np.pi, 1e-8)
    assert found is not None
    exponents = fl.floquet(system.feedback(found.K)).exponents
    assert -3e-3 < exponents.real.max() < 0
    assert found.error <= 1e-8
    assert found.X(0.0) == pytest.approx(found.X(2 * np.pi), rel=1e-12)


def test_bounds_cover_what_is_added_to_the_solution():
    """The residual of a wrong X beside its running cost bounds how wrong it is; carried through the loop it does so more closely."""
    system, Q, R, N = random_problem(5)
    problem, _ = resolve_problem(linear_quadratic(system, Q, R, N), system)
    right = solve_by_sweeps(problem, 2.0, 1e-10)
    sampler, rng = RiccatiSampler(problem, 2.0, find_sweeps()), np.random.default_rng(1)
    rows, samples = np.tril_indices(system.n), sampler.sample(1024)
    for size in (1e-8, 1e-5, 1e-3):
        old = right.series.coefficients
        parts = right.series.coefficients.copy()
        change = rng.standard_normal((system.n, system.n)) * np.sqrt(np.outer(np.diag(old[0]), np.diag(old[0])))
        parts[rng.integers(0, 3)] += size * (change + change.T)
        series = np.ascontiguousarray(parts[:, *rows])
        wrong = judge_by_cost(sampler, samples, series, 1, 5.0, 1.0)
        carried = judge_by_cost(sampler, samples, series, 1, 5.0, 0.1 * wrong.error) if wrong else None
        if wrong is None:
            assert size > 1e-5
            continue
        t = np.linspace(0, 2, 99)
        true = np.abs(wrong.X(t) - right.X(t)).max() / np.abs(right.X(t)).max()
        assert true <= wrong.error <= 1e4 * true
        K, wanted = wrong.K(t), right.K(t)
        apart = np.abs(K - wanted).max() / np.abs(wanted).max()
        assert apart <= wrong.gain_error
        if wrong.error < 0.01:
            assert true <= carried.error < wrong.error
            assert apart <= carried.gain_error <= wrong.gain_error


@pytest.mark.parametrize(
    ("A", "B", "Q"),
    [
        ([[0.0, 0.0], [0.0, -1.0]], [[0.0], [1.0]], np.eye(2)),
        ([[1.0, 0.0], [0.0, -1.0]], [[1.0], [1.0]], np.diag([0.0, 1.0])),
        ([[0.0, 1.0], [-1e8, -1.0]], [[0.0], [1.0]], np.eye(2)),
        ([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], 1e-26 * np.eye(2)),
    ],
    ids=["not reached", "not seen", "fast", "hardly seen"],
)
def test_what_sweeps_cannot_prove_they_decline(A, B, Q):
    system = fl.PeriodicSystem(A, 1.0, B)
    problem, _ = resolve_problem(linear_quadratic(system, Q, 1.0), system)
    assert solve_by_sweeps(problem, 1.0, 1e-9) is None
