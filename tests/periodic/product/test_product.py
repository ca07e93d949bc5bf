"""Eigenvalues of a product of factors, and its eigenvectors: what they say of perturbations."""

import mpmath
import numpy as np
import pytest
import scipy.linalg

from flexlin.periodic import Unknown, complex_schur, find_spectrum, match_logs


def framed(blocks, rng):
    """Factors Q_(k+1) T_k Q_k' with random orthogonal Q, Q_K = Q_0: the product is similar to that of the T_k."""
    n = blocks.shape[-1]
    Q = np.linalg.qr(rng.standard_normal((len(blocks), n, n)))[0]
    return np.roll(Q, -1, axis=0) @ blocks @ np.swapaxes(Q, 1, 2)


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.mark.parametrize(
    ("count", "rate", "above"),
    [(count, np.array([0.31, 0.05, -0.02, -0.4]), 0.1) for count in (1, 2, 3, 17, 400, 5000)]
    + [(1000, np.log(10) * np.array([1.3, 0.2, 0.0, -1.3]), 1.0), (30, -0.02 * np.arange(12), 0.05)],
)
def test_triangular_products_of_any_length(count, rate, above, rng):
    """Also moduli from 1e-1300 to 1e1300, and a ladder of twelve, exp(-0.6) apart: no gap is wide, the whole range is not small."""
    n = len(rate)
    T = np.triu(above * rng.standard_normal((count, n, n)), 1) + np.diag(np.exp(rate))
    found = find_spectrum(framed(T, rng))
    np.testing.assert_allclose(found.logs, rate * count, rtol=1e-12, atol=1e-11 if n == 4 else 1e-9)
    assert np.all(np.abs(found.logs - rate * count) <= found.rounding + 1e-13)


def test_complex_pairs_of_equal_moduli_beside_a_fast_mode(rng):
    """Two rotations of modulus 1 and a real mode of exp(-3) a factor, 100 factors."""
    turns = ([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]] for angle in (0.3, 0.7))
    T = np.tile(scipy.linalg.block_diag(*turns, -np.exp(-3)), (100, 1, 1))
    logs = find_spectrum(framed(T, rng)).logs
    expected = np.array([30j, -30j, 70j, -70j, -300])
    assert match_logs(logs, expected)[1].max() < 1e-12
    odd = find_spectrum(framed(T[:99], rng)).logs
    assert abs(odd[-1] - (-297 + 1j * np.pi)) < 1e-11


def test_a_defective_pair_reports_its_rounding(rng):
    found = find_spectrum(framed(np.tile([[1.0, 0.1], [0, 1.0]], (10, 1, 1)), rng))
    assert np.all(np.abs(found.logs) <= found.rounding)
    assert found.rounding.max() < 1e-6


@pytest.mark.parametrize("seed", [1, 11, 36])
def test_ill_conditioned_factors_leave_no_false_cluster(seed):
    """Factors of condition up to 1e8 in unrelated frames: the logs agree with those of the QR diagonals after many sweeps."""
    rng = np.random.default_rng(seed)
    frames = np.linalg.qr(rng.standard_normal((2, 60, 12, 12)))[0]
    F = frames[0] @ (np.exp(rng.normal(0, 2.5, (60, 12)))[:, :, None] * frames[1])
    logs = find_spectrum(F).logs
    Q, size = np.eye(12), np.zeros(12)
    for _ in range(6):
        size[:] = 0
        for factor in F:
            Q, R = np.linalg.qr(factor @ Q)
            size += np.log(np.abs(np.diag(R)))
    np.testing.assert_allclose(logs.real, np.sort(size)[::-1], atol=1e-6)


@pytest.mark.parametrize(("n", "gap", "swing", "known"), [(12, 40, 7, 1e-5), (5, 3, 20, np.inf)])
def test_modes_that_overtake_each_other_within_the_period(n, gap, swing, known):
    """Rounding where a mode is small is no coupling at the end; a mode among others that are lost in rounding is not known either."""
    expected, angle = -float(gap) * np.arange(n), 2 * np.pi * np.arange(60) / 60
    for seed in range(6):
        rng = np.random.default_rng(seed)
        rate = expected / 60 + swing * np.pi / 60 * np.cos(angle[:, None] + rng.uniform(0, 2 * np.pi, n))
        T = np.triu(0.05 * rng.standard_normal((60, n, n)), 1) + np.eye(n) * np.exp(rate)[:, :, None]
        found = find_spectrum(framed(T, rng))
        assert np.all(np.abs(found.logs - expected) <= 2 * found.rounding)
        assert found.rounding.max() < known


@pytest.mark.parametrize("count", [2, 6])
@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_a_factor_whose_column_vanishes_hides_one_mode_alone(rng, n, count):
    F = rng.standard_normal((count, n, n))
    F[0, :, 0] = 0
    known = np.sort(np.abs(np.linalg.eigvals(np.linalg.multi_dot(F[::-1]))))[::-1]
    found = find_spectrum(F).logs.real
    np.testing.assert_allclose(found[:-1], np.log(known[:-1]), atol=1e-9)
    assert found[-1] < -30


@pytest.mark.parametrize("count", [1, 3, 8])
@pytest.mark.parametrize("chain", [1, 2, 3])
def test_a_chain_without_memory_leaves_the_errors_of_other_modes_small(rng, count, chain):
    """Zeros in a chain, as of a dead-beat controller: rounding makes any small number of them, before, among or behind the others."""
    kept = np.array([0.9, 0.5, 0.3, 0.2])[: 5 - chain]
    for turned in [False, True] * 10:
        T = np.zeros((5, 5))
        T[:chain, :chain] = np.diag(np.full(chain - 1, 3.0), 1)
        T[chain:, chain:] = np.triu(0.3 * rng.standard_normal((5 - chain, 5 - chain)), 1) + np.diag(kept)
        T[:chain, chain:] = rng.standard_normal((chain, 5 - chain))
        found = find_spectrum(framed(np.tile(T.T if turned else T, (count, 1, 1)), rng), part=True)
        missed, stated = np.abs(found.logs[: 5 - chain].real - count * np.log(kept)), found.rounding[: 5 - chain]
        assert np.all(missed <= 8 * stated + 1e-14)
        assert stated.max() < 1e-9
        assert found.logs[5 - chain :].real.max() < -8


@pytest.mark.parametrize("limit", [0.0, 1000.0])
@pytest.mark.parametrize("count", [1, 7, 40])
def test_unknown_couplings_are_those_of_the_vectors(rng, count, limit):
    """|L left| size |right R| summed over the factors, and linear in the size: what stands before each factor, in units of the states."""
    F = framed(np.triu(0.2 * rng.standard_normal((count, 4, 4)), 1) + np.diag(np.exp([0.2, 0.1, 0.0, -0.2])), rng)
    size, left = rng.random((count, 2, 3)), rng.standard_normal((count, 4, 2))
    right, none = rng.standard_normal((count, 3, 4)), find_spectrum(F, limit=limit).rounding
    unknowns = [Unknown(part * size, left, right) for part in (1e-9, 2e-9)]
    both = [find_spectrum(F, None, unknown, limit=limit).rounding - none for unknown in unknowns]
    np.testing.assert_allclose(both[1], 2 * both[0], rtol=1e-3)
    if limit == 0.0 and count > 1:
        values, R = np.linalg.eig(np.linalg.multi_dot(F[::-1]))
        noise = np.zeros(4)
        for k in range(count):
            L = np.linalg.inv(R)
            noise += np.einsum("ia,aj,ji->i", np.abs(L @ left[k]), 1e-9 * size[k], np.abs(right[k] @ R))
            R = F[k] @ R
        order = np.argsort(-np.log(np.abs(values)), kind="stable")
        np.testing.assert_allclose(both[0], noise[order], rtol=1e-4)


def test_schur_forms_are_those_of_scipy():
    rng = np.random.default_rng(3)
    for n in (1, 2, 6, 70):
        A = rng.standard_normal((n, n))
        for given in (A, A + 1j * rng.standard_normal((n, n))):
            T, Z = complex_schur(given)
            assert np.abs(Z @ T @ Z.conj().T - given).max() < 1e-13 * n
            assert not np.tril(T, -1).any()
            assert np.array_equal(T, scipy.linalg.schur(given, output="complex")[0])


def exact_logs(factors):
    """Logs of the product's eigenvalues with 80 digits."""
    with mpmath.workdps(80):
        P = mpmath.eye(factors.shape[-1])
        for F in factors:
            P = mpmath.matrix(F.tolist()) * P
        values = mpmath.eig(P, left=False, right=False)
        return np.array([complex(mpmath.log(v)) for v in values])


def moved(motion, factors):
    """How far the logs move to those of other factors."""
    return match_logs(motion.logs, exact_logs(factors))[1]


def test_first_order_motion_is_exact_to_second_order(rng):
    """Of factors with two complex pairs in unrelated well-conditioned frames."""
    frames = np.eye(5) + 0.3 * rng.standard_normal((6, 5, 5)) / np.sqrt(5)
    sizes, angles = np.exp(rng.uniform(-1, 0, 3)), rng.uniform(0.1, 3, 2)
    turns = (np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a in angles)
    block = scipy.linalg.block_diag(*map(np.multiply, sizes, turns), sizes[2])
    F = np.roll(frames, -1, axis=0) @ block @ np.linalg.inv(frames)
    change = rng.standard_normal(F.shape) * np.abs(F).max(axis=(1, 2), keepdims=True)
    missed = []
    for size in (1e-5, 1e-6):
        motion = find_spectrum(F, F + size * change, limit=0.0)
        missed.append(match_logs(motion.logs + motion.shift, exact_logs(F + size * change))[1].max())
        assert np.all(moved(motion, F + size * change) <= 1.01 * motion.method + motion.rounding)
    assert 1.8 < np.log10(missed[0] / missed[1]) < 2.2


@pytest.mark.parametrize("m", [2, 3, 4])
def test_a_jordan_chain_that_breaks_up_stays_inside_the_bound(m, rng):
    """A chain of m equal multipliers, shaken by 1e-8: it spreads by 1e-8 to the power 1 / m."""
    block = np.eye(m) + np.diag(np.full(m - 1, 0.5), 1)
    frames = np.linalg.qr(rng.standard_normal((4, m, m)))[0]
    F = np.roll(frames, -1, axis=0) @ np.tile(block, (4, 1, 1)) @ np.swapaxes(frames, 1, 2)
    better = F + 1e-8 * rng.standard_normal(F.shape)
    motion = find_spectrum(F, better, limit=0.0)
    distance = moved(motion, better)
    assert np.all(distance <= 1.5 * motion.method + motion.rounding)
    assert motion.method.max() < 30 * distance.max()


def test_a_multiplier_beside_a_jordan_chain_moves_as_far_as_the_chain_lets_it(rng):
    """By the square of what couples the chain over its distance, 0.5 / 0.01: by vectors of the chain alone it would be that itself."""
    block = np.array([[1.0, 0.5, 0.5], [0.0, 1.01, 0.5], [0.0, 0.0, 1.01]])
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    for order in (block, block[::-1, ::-1].T):
        F = (Q @ order @ Q.T)[None]
        better = F + 1e-10 * rng.standard_normal(F.shape)
        motion = find_spectrum(F, better)
        assert np.all(moved(motion, better) <= 1.5 * motion.method + motion.rounding)


@pytest.mark.parametrize("mixed", [0.0, 1e-12])
def test_modes_that_swing_far_apart_get_a_bound_that_holds(mixed):
    """One of two modes grows by exp(4000) against the other and decays again: the bound may say nothing, but it is one."""
    swing = 40 * np.cos(2 * np.pi * np.arange(400) / 400)
    factors = np.exp(np.stack([np.full(400, -0.001), swing + 0.1], axis=1))[:, :, None] * np.eye(2)
    factors[:, 0, 1] = mixed
    motion = find_spectrum(factors, factors * (1 + 1e-9), limit=0.0)
    error = np.abs(motion.logs.real - [40.0, -0.4])
    assert np.all(error <= motion.method + motion.rounding)
