"""Compiled transition matrices of second order against NumPy's, on systems that share no code with them."""

import mpmath as mp
import numpy as np
import pytest

import flexlin as fl
from flexlin.errors import SingularMassMatrix
from flexlin.periodic import gauss_transitions
from flexlin.periodic.transition import factors
from flexlin.periodic.transition.factors import factor_segments
from flexlin.periodic.transition.gauss import gauss
from tests.periodic.transition.second_order import second_order_transitions

EPS = np.finfo(float).eps


def random_arm(seed, n, units):
    """M, D, K that move by a tenth, stiff and damped, not symmetric, in units of the coordinates (n,); period 1."""
    rng = np.random.default_rng(seed)
    root, small = rng.standard_normal((n, n)), 0.05 * rng.standard_normal((3, 2, n, n))
    fixed = [np.eye(n) + 0.1 * root @ root.T, *(10 ** rng.uniform(0, 1.5, 2)[:, None, None] * (np.eye(n) + 0.1 * root))]
    fixed[2] = fixed[2] * 10 ** rng.uniform(0, 2)

    def part(k):
        def of(t):
            waves = np.stack([np.cos(2 * np.pi * t), np.sin(4 * np.pi * t)], axis=1)
            values = fixed[k] * (1 + np.einsum("tw,wij->tij", waves, small[k]))
            return values * units * units[:, None]

        return of

    return fl.PeriodicSystem.from_second_order(part(0), part(1), part(2), 1.0, complete=True)


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_compiled_code_and_numpy_give_the_same_matrices(n, monkeypatch):
    """Also where segments do not fill an eight, in several parts, in units of any size, and so long that rows must be exchanged."""
    for seed, (segments, stages) in enumerate([(1, 9), (8, 4), (37, 7), (3, 10), (100, 2)]):
        monkeypatch.setattr(factors, "CHUNK_BYTES", 24 * stages * n * n * 16)
        grid = np.sort(np.random.default_rng(seed).uniform(0, 1, segments + 1))
        units = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, n)
        found = factor_segments(random_arm(seed, n, units).resolved, grid, gauss(stages))
        other = second_order_transitions(random_arm(seed, n, np.ones(n)).resolved.sample, grid, stages)
        scale = np.concatenate([units, units])
        apart = np.abs(found * (scale[:, None] / scale) - other).max(axis=(1, 2))
        assert (apart <= 500 * EPS * np.linalg.norm(other, axis=(1, 2))).all(), (seed, apart.max())


@pytest.mark.parametrize(("m", "k"), [(1, 0), (1, 3), (3, 1), (4, 6), (6, 5)])
def test_integrals_among_the_states_are_left_out_of_the_unknowns(m, k):
    """x = [y; v; z], y' = v, as of an arm with a controller, in units of any size; the other way has all states as unknowns."""
    n, stages, segments = 2 * m + k, 9, 13
    for seed in range(4):
        rng = np.random.default_rng([seed, m, k])
        edges, units = np.sort(rng.uniform(0, 1, segments + 1)), 10.0 ** rng.uniform(-3, 3, n)
        units[m : 2 * m] = units[:m]
        fixed, waves = 10 ** rng.uniform(0, 1.5) * rng.standard_normal((2, n, n))
        fixed[:m], waves[:m] = np.eye(m, n, m), 0.0

        def A(t, fixed=fixed, waves=waves):
            return fixed + 0.1 * np.cos(2 * np.pi * t)[:, None, None] * waves

        system = fl.PeriodicSystem(lambda t, A=A, u=units: A(t) * u[:, None] / u, 1.0, complete=True)
        found, other = factor_segments(system.resolved, edges, gauss(stages)), gauss_transitions(A, edges, stages)
        apart = np.abs(found / units[:, None] * units - other).max(axis=(1, 2))
        assert (apart <= 500 * EPS * np.linalg.norm(other, axis=(1, 2))).all(), (seed, apart.max())


def exact_transition(M, D, K, rule):
    """R (hA) for h = 1 in 40 digits: [1, 1; 0, 1] + [b (1 - c); b] w of the stages' accelerations w."""
    s, n = len(rule.b), len(M)
    with mp.workdps(40):
        a = mp.matrix(rule.a.tolist())
        square, G, right = a * a, mp.matrix(s * n), mp.matrix(s * n, 2 * n)
        for i, p, q in np.ndindex(s, n, n):
            for j in range(s):
                G[i * n + p, j * n + q] = a[i, j] * D[p, q] + square[i, j] * K[p, q] + (M[p, q] if i == j else 0)
            right[i * n + p, q], right[i * n + p, n + q] = -K[p, q], -D[p, q] - mp.mpf(rule.c[i]) * K[p, q]
        w = mp.inverse(G) * right
        Phi = mp.eye(2 * n)
        for p, c in np.ndindex(n, 2 * n):
            own = [mp.mpf(b) * w[i * n + p, c] for i, b in enumerate(rule.b)]
            Phi[p, c] += mp.fsum(x * (1 - mp.mpf(t)) for x, t in zip(own, rule.c, strict=True)) + (c == n + p)
            Phi[n + p, c] += mp.fsum(own)
        return np.array(Phi.tolist(), dtype=float)


@pytest.mark.parametrize("seed", range(4))
def test_inertias_far_apart_lose_no_more_than_with_rows_exchanged(seed, monkeypatch):
    """Fast modes of a nearly singular mass matrix: elimination without exchanges alone misses by some hundred roundings in half of them."""
    left, n, rng = [], 2, np.random.default_rng(100 + seed)
    collocate = factors.collocate_accelerations
    monkeypatch.setattr(factors, "collocate_accelerations", lambda M, *rest: left.append(len(M)) or collocate(M, *rest))
    turn, back = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    modes, rates = turn * np.array([1.0, 10 ** rng.uniform(-4, -2)]) @ back, rng.uniform(3, 10, n)
    M, D, K = (modes.T @ (part[:, None] * modes) for part in (np.ones(n), 0.1 * rates, rates**2))
    system, edges = fl.PeriodicSystem.from_second_order(M, D, K, 1.0), np.array([0.0, 1.0])
    found = factor_segments(system.resolved, edges, gauss(9))[0]
    assert not left
    right = exact_transition(M, D, K, gauss(9))
    units = [1.0, 1 / 3, 0.7, 1.9]  # of the forces: the same equations, rounded in another way each
    others = [
        second_order_transitions(lambda t, u=u: [u * part for part in system.resolved.sample(t)], edges, 9)[0]
        for u in units
    ]
    allowed = max(np.linalg.norm(other - right, 2) for other in others)
    assert np.linalg.norm(found - right, 2) <= 2 * allowed + 20 * EPS * np.linalg.norm(right, 2)


def test_what_needs_rows_exchanged_is_seen_and_left_to_numpy(monkeypatch):
    """A pivot that vanishes: h^2 (a a)_11 k = -1, with the residual as the only witness."""
    left = []
    collocate = factors.collocate_accelerations
    monkeypatch.setattr(factors, "collocate_accelerations", lambda M, *rest: left.append(len(M)) or collocate(M, *rest))
    rule = gauss(3)
    stiffness = -1.0 / (rule.a @ rule.a)[0, 0]
    system = fl.PeriodicSystem.from_second_order([[1.0]], [[0.0]], [[stiffness]], 1.0)
    grid = np.linspace(0, 1.0, 2)
    found = factor_segments(system.resolved, grid, gauss(3))
    assert left == [1]
    np.testing.assert_allclose(found, second_order_transitions(system.resolved.sample, grid, 3), rtol=1e-12)


def test_a_mass_matrix_that_is_singular_is_named():
    M = [[1.0, 0.0], [0.0, 0.0]]
    system = fl.PeriodicSystem.from_second_order(np.eye(2), np.zeros((2, 2)), np.eye(2), 1.0)
    blocks = system.resolved
    blocks.series.coefficients[0, :, :2] = M
    blocks.series.coefficients[0, :, 4:] = np.diag([1.0, 0.0])
    with pytest.raises(SingularMassMatrix):
        factor_segments(system.resolved, np.linspace(0, 1, 4), gauss(2))
