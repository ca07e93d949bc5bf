"""Collocation by Gauss and Radau: orders, exponentials, breaks, units; compiled transition matrices of second order against NumPy."""

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import block_diag

import flexlin as fl
from flexlin.errors import SingularMassMatrix
from flexlin.periodic import factor_by, gauss_transitions, place_edges
from flexlin.periodic.transition import factors
from flexlin.periodic.transition.gauss import gauss, place_nodes
from tests.periodic.judge import covers
from tests.periodic.systems import lyapunov_transformed, mathieu, meissner, waving_arm


@pytest.mark.parametrize(("method", "order"), [("gauss", k) for k in (2, 4, 6)] + [("radau", k) for k in (1, 3, 5)])
def test_order_of_convergence(method, order):
    A, count = mathieu(1.3, 0.7), np.array([16, 32, 64])

    def product(factors):
        return np.linalg.multi_dot(factors[::-1])

    exact, system = product(gauss_transitions(A, np.linspace(0, np.pi, 41), 10)), fl.PeriodicSystem(A, np.pi)
    found = [product(factor_by(system, np.linspace(0, np.pi, k + 1), method, order)) for k in count]
    slope = -np.polyfit(np.log(count), np.log(np.abs(found - exact).max(axis=(1, 2))), 1)[0]
    assert abs(slope - order) < 0.3


def test_chunks_do_not_change_the_result(monkeypatch):
    grid = np.linspace(0, np.pi, 12)
    whole = gauss_transitions(mathieu(3.0, 2.0), grid, 3)
    monkeypatch.setattr(factors, "CHUNK_BYTES", 2 * 6 * 6 * 8)
    np.testing.assert_array_equal(gauss_transitions(mathieu(3.0, 2.0), grid, 3), whole)


def test_the_last_stage_stays_before_a_break():
    grid = place_edges(np.pi, (np.pi / 3,), 8)
    found = factor_by(fl.PeriodicSystem(meissner, np.pi, breaks=(np.pi / 3,)), grid, "radau", 11)
    np.testing.assert_allclose(found, gauss_transitions(meissner, grid, 6), atol=1e-11)


@pytest.mark.parametrize(("method", "order"), [("auto", None), ("gauss", 8), ("radau", 9)])
@pytest.mark.parametrize("seed", range(3))
def test_units_of_the_states_move_no_exponent(method, order, seed):
    """The exponents know nothing of units, however far apart these are.

    Elimination without like units lost all digits here: errors of 1e5, or "needs 25,000 segments".
    """
    rng, constant = np.random.default_rng(seed), block_diag([[-0.3, 2.7], [-2.7, -0.3]], 0.2)
    plain = lyapunov_transformed(constant, 2.0, 2, rng)
    units = 2.0 ** rng.integers(-40, 40, 3)
    system = fl.PeriodicSystem(lambda t: plain(t) * (units / units[:, None]), np.pi)
    found = fl.floquet(system, 1e-8, method=method, order=order)
    known = np.array([0.2, -0.3 + 0.7j, -0.3 - 0.7j])  # folded by i omega = 2 i
    assert found.verdict == "unstable"
    assert covers(found, known, np.pi)
    assert found.error < 1e-6


EPS = np.finfo(float).eps


def second_order_transitions(second, edges, stages):
    """By NumPy alone, of M y'' + D y' + K y = 0 for x = [y; y'], (K, 2n, 2n); second: times (N,) -> M, D, K."""
    rule, found = gauss(stages), []
    for t, h in zip(place_nodes(edges, rule.c), np.diff(edges), strict=True):
        M, D, K = second(t)
        n, (a, b, c) = M.shape[1], (rule.a, rule.b, rule.c[:, None, None])
        G = np.einsum("ij,ikl->ikjl", h * a, D) + np.einsum("ij,ikl->ikjl", h * h * a @ a, K)
        G += np.einsum("ij,ikl->ikjl", np.eye(stages), M)
        right = -np.concatenate([K, D + h * c * K], axis=2)
        w = np.linalg.solve(G.reshape(stages * n, -1), right.reshape(stages * n, -1)).reshape(right.shape)
        moved = np.vstack([h * h * np.tensordot(b * (1 - rule.c), w, 1), h * np.tensordot(b, w, 1)])
        found.append(np.kron([[1, h], [0, 1]], np.eye(n)) + moved)
    return np.array(found)


@pytest.fixture
def left(monkeypatch):
    """How many segments the accelerations leave to the states, each time that they do."""
    counts, solve = [], factors.factor_states

    def counted(A, *rest):
        counts.append(len(A))
        return solve(A, *rest)

    monkeypatch.setattr(factors, "factor_states", counted)
    return counts


def random_arm(seed, n, units):
    """M, D, K that move by a tenth, stiff and damped, not symmetric, in units of the coordinates (n,); period 1."""
    rng = np.random.default_rng(seed)
    skew = np.eye(n) + 0.1 * rng.standard_normal((n, n))
    damping, stiffness = 10 ** rng.uniform(0, [1.5, 3.5])
    fixed, sizes = [skew @ skew.T, damping * skew, stiffness * skew], 0.05 * np.array([1.0, damping, stiffness])
    return waving_arm(rng, fixed, sizes, units)


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_compiled_code_and_numpy_give_the_same_matrices(n, monkeypatch):
    """Also where segments do not fill an eight, in several parts, in units of any size, and so long that rows must be exchanged."""
    for seed, (segments, stages) in enumerate([(1, 9), (8, 4), (37, 7), (3, 10), (100, 2)]):
        monkeypatch.setattr(factors, "CHUNK_BYTES", 24 * stages * n * n * 16)
        grid = np.sort(np.random.default_rng(seed).uniform(0, 1, segments + 1))
        units = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, n)
        found = factors.factor_segments(random_arm(seed, n, units).resolved.series, grid, gauss(stages))
        other = second_order_transitions(random_arm(seed, n, np.ones(n)).resolved.sample, grid, stages)
        scale = np.concatenate([units, units])
        apart = np.abs(found * (scale[:, None] / scale) - other).max(axis=(1, 2))
        assert (apart <= 500 * EPS * np.linalg.norm(other, axis=(1, 2))).all(), (seed, apart.max())


def exact_transition(M, D, K, rule):
    """R (hA) for h = 1 in 40 digits: [1, 1; 0, 1] + [b (1 - c); b] w of the stages' accelerations w."""
    n, one = len(M), np.ones((len(rule.b), 1))
    with mp.workdps(40):
        a, b, c = (np.vectorize(mp.mpf)(part) for part in (rule.a, rule.b, rule.c))
        G = np.kron(a, D) + np.kron(a @ a, K) + np.kron(np.eye(len(a)), M)
        right = -np.hstack([np.kron(one, K), np.kron(one, D) + np.kron(c[:, None], K)])
        w = mp.inverse(mp.matrix(G.tolist())) * mp.matrix(right.tolist())
        w = np.array(w.tolist()).reshape(len(a), n, 2 * n)
        Phi = np.kron([[1, 1], [0, 1]], np.eye(n)) + np.vstack([np.tensordot(b * (1 - c), w, 1), np.tensordot(b, w, 1)])
        return Phi.astype(float)


@pytest.mark.parametrize("seed", range(4))
def test_inertias_far_apart_lose_no_more_than_with_rows_exchanged(seed, left):
    """Fast modes of a nearly singular mass matrix: elimination without exchanges alone misses by some hundred roundings in half of them."""
    n, rng = 2, np.random.default_rng(100 + seed)
    turn, back = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    modes, rates = turn * np.array([1.0, 10 ** rng.uniform(-4, -2)]) @ back, rng.uniform(3, 10, n)
    M, D, K = (modes.T @ (part[:, None] * modes) for part in (np.ones(n), 0.1 * rates, rates**2))
    system, edges = fl.PeriodicSystem.from_second_order(M, D, K, 1.0), np.array([0.0, 1.0])
    found = factors.factor_segments(system.resolved.series, edges, gauss(9))[0]
    assert not left
    right = exact_transition(M, D, K, gauss(9))
    allowed = 0.0
    for unit in (1.0, 1 / 3, 0.7, 1.9):  # of the forces: the same equations, rounded in another way each
        other = second_order_transitions(lambda t, u=unit: [u * part for part in system.resolved.sample(t)], edges, 9)
        allowed = max(allowed, np.linalg.norm(other[0] - right, 2))
    assert np.linalg.norm(found - right, 2) <= 2 * allowed + 20 * EPS * np.linalg.norm(right, 2)


def test_what_needs_rows_exchanged_is_seen_and_left_to_the_states(left):
    """A pivot that vanishes: h^2 (a a)_11 k = -1, with the residual as the only witness."""
    stiffness, grid = -1.0 / (gauss(3).a @ gauss(3).a)[0, 0], np.array([0.0, 1.0])
    system = fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], [[stiffness]], 1.0)
    found = factors.factor_segments(system.resolved.series, grid, gauss(3))
    assert left == [1]
    np.testing.assert_allclose(found, second_order_transitions(system.resolved.sample, grid, 3), rtol=1e-12)


def test_a_mass_matrix_that_is_singular_is_named():
    system = fl.PeriodicSystem.from_second_order(np.eye(2), np.zeros((2, 2)), np.eye(2), 1.0)
    for part in (slice(0, 2), slice(4, 6)):
        system.resolved.series.coefficients[0, :, part] = np.diag([1.0, 0.0])
    with pytest.raises(SingularMassMatrix):
        factors.factor_segments(system.resolved.series, np.linspace(0, 1, 4), gauss(2))
