"""Eigenvectors along a product: what they say of perturbations."""

import mpmath
import numpy as np
import pytest
from scipy.linalg import block_diag

from flexlin.periodic import find_spectrum, match_logs


@pytest.fixture
def rng():
    return np.random.default_rng(5)


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
    turns = [
        r * np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for r, a in zip(sizes[:2], angles, strict=True)
    ]
    block = block_diag(*turns, sizes[2])
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
