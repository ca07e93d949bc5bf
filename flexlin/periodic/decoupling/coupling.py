"""What the coupling that is left between groups of modes does to the exponents."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.decoupling.grouping import Group, block_mask
from flexlin.periodic.decoupling.superadiabatic import SLOW_PART, sylvester
from flexlin.periodic.decoupling.waves import circle_derivative, harmonics

STILL = 8.0
"""Modes that grow by less than exp(STILL) against each other within a period do not bring out what is hidden."""
LARGEST = 400.0
"""Growths beyond exp(LARGEST) count as that: neither says anything."""
LINKED = 1e-3
"""Modes whose multipliers are moved less by each other do not take each other's place."""


@dataclass(frozen=True)
class Separation:
    """How far the groups of each pair of modes stay apart (n, n): least gap of eigenvalues at the nodes, and on the straight lines
    between them too; the gap's ratio to the least difference of real parts of one sign (inf: none); how much one may grow against
    the other within the period. outside: not in one group."""

    gap: Array
    crossing: Array
    oblique: Array
    swing: Array
    outside: Array


def group_separation(B: Array, period: float, groups: tuple[Group, ...]) -> Separation:
    """The separations of the groups from the eigenvalues of the diagonal blocks of B (N, n, n)."""
    values = np.concatenate([np.linalg.eigvals(B[:, g.part, g.part]) for g in groups], axis=1)
    starts, size = np.array([g.start for g in groups]), [g.size for g in groups]

    def least(pairs: Array) -> Array:
        small = np.minimum.reduceat(np.minimum.reduceat(pairs, starts, axis=0), starts, axis=1)
        return np.repeat(np.repeat(small, size, axis=0), size, axis=1)

    apart = values[:, :, None] - values[:, None, :]
    gap = least(np.abs(apart).min(axis=0))
    single = np.repeat(size, size) == 1
    crossing = np.where(single[:, None] & single, nearest_on_chords(apart), gap)
    above = least((values.real[:, :, None] - values.real[:, None, :]).min(axis=0))
    damping = np.maximum(0, np.maximum(above, above.T))
    mean = np.repeat(np.add.reduceat(values.real, starts, axis=1) / size, size, axis=1)
    run = np.cumsum(mean - mean.mean(axis=0), axis=0) * period / len(B)
    swing = np.ptp(run[:, :, None] - run[:, None, :], axis=0)
    oblique = np.divide(gap, damping, out=np.full_like(gap, np.inf), where=damping > 0)
    return Separation(gap, crossing, oblique, np.exp(np.minimum(swing, 600.0)), ~block_mask(groups))


def nearest_on_chords(z: Array) -> Array:
    """The least distance from zero of closed polygons with the corners z (N, ...): modes may cross between two nodes."""
    step = np.roll(z, -1, axis=0) - z
    length = np.maximum(np.abs(step) ** 2, np.finfo(float).tiny)
    part = np.clip(-(z * step.conj()).real / length, 0, 1)
    return np.abs(z + part * step).min(axis=0)


def pair_effects(B: Array, S: Array, apart: Separation, rough: Array) -> Array:
    """What the elimination of mode j does to mode i at most (n, n), in 1/s; rough (n, n): the part of B_ij that may meet a resonance."""
    second = np.abs(B).max(axis=0) * np.abs(S).max(axis=0).T
    return np.where(apart.outside, combined(second, np.sqrt(rough * rough.T), apart.oblique, apart.swing), 0)


def combined(second: Array, first: Array, oblique: Array, swing: Array) -> Array:
    """The lesser of two bounds: by damping, second-order and oblique; or second-order and a resonance of first order."""
    with np.errstate(invalid="ignore"):
        by_damping = np.where(second == 0, 0, second * oblique)
    return np.minimum(by_damping, second / (1 - SLOW_PART) + first * swing)


def residual_effect(B: Array, period: float, groups: tuple[Group, ...]) -> Array:
    """Bound the generator that the coupling adds to each diagonal block when the other modes are eliminated, entry by entry (n, n).

        d B_kl ~ sum over j outside of  R_kj S_jl,   S of the Sylvester equations

    Where the real parts of two groups stay apart by r, elimination needs no smoothness and costs gap / r more. Elsewhere the
    harmonics of R above SLOW_PART of the gap could meet the modes' beat in resonance: they enter at first order,
    sqrt(|R_kj R_jl|), times what one mode may grow against the other within the period.

    Source: Coppel, Dichotomies in Stability Theory (1978), for the first; Yakubovich, Starzhinskii (1975), IV, for the second.
    """
    apart = group_separation(B, period, groups)
    S = sylvester(B, groups)
    R = np.where(apart.outside, B, 0)
    X, Z = np.abs(R).max(axis=0), np.abs(S).max(axis=0)
    rough = np.abs(high_harmonics(R, period, apart.crossing)).max(axis=0)
    total = np.zeros_like(X)
    for g in groups:
        second = np.einsum("kj,jl->kjl", X[g.part], Z[:, g.part])
        first = np.sqrt(np.einsum("kj,jl->kjl", rough[g.part], rough[:, g.part]))
        both = combined(second, first, apart.oblique[g.part, :, None], apart.swing[g.part, :, None])
        total[g.part, g.part] = np.where(apart.outside[g.part, :, None], both, 0).sum(axis=1)
    return total


def hidden_effect(B: Array, period: float, groups: tuple[Group, ...], rounding: Array) -> Array:
    """Bound what couplings that no round can take away add to each diagonal block, entry by entry (n, n), where damping crosses.

        d lambda_i ~ c^2 / max(|lambda_i - lambda_j|, c),   c^2 = F_ij F_ji exp(g_ij)

    A mode that falls behind another by exp(g) and catches up again follows the other one in between, if as little as exp(-g / 2) of it
    goes over and comes back, however smooth A is.

    Parameters: rounding (n, n): of the entries of B (N, n, n), in 1/s.
    Source: Berry, Uzdin, Slow non-Hermitian cycling, J. Phys. A 44 (2011), 435303.
    """
    total = np.zeros(rounding.shape)
    if is_still(B, period):
        return total
    F, caught_up = hidden_couplings(B, period, groups, rounding), catch_up(B, period, groups)
    logs, single = (
        np.einsum("tii->ti", B).mean(axis=0) * period,
        np.repeat(*np.array([[g.size] * 2 for g in groups]).T) == 1,
    )
    gap = np.where(single[:, None] & single, measure_distances(logs, logs) / period, 0)
    for g in groups:
        size = np.sqrt(np.einsum("kj,jl->kjl", F[g.part], F[:, g.part])) * caught_up[g.part, :, None]
        share = size / np.maximum(np.maximum(gap[g.part, :, None], size), np.finfo(float).tiny)
        total[g.part, g.part] = (size * share).sum(axis=1)
    return total


def link_modes(B: Array, period: float, groups: tuple[Group, ...], rounding: Array) -> Array:
    """Pairs of modes (n, n) of which one may go over to the other and come back, as far as anybody can see."""
    apart = group_separation(B, period, groups)
    rough = np.abs(high_harmonics(B, period, apart.crossing)).max(axis=0)
    with np.errstate(invalid="ignore"):
        seen = np.sqrt(rough * rough.T) * apart.swing
    F, caught_up = hidden_couplings(B, period, groups, rounding), catch_up(B, period, groups)
    linked = np.maximum(seen, np.sqrt(F * F.T) * caught_up) * period > LINKED
    return np.asarray(linked & apart.outside & np.isinf(apart.oblique))


def is_still(B: Array, period: float) -> bool:
    """Whether no two modes grow by much against each other within the period."""
    real = B.reshape(len(B), -1)[:, :: B.shape[-1] + 1].real
    run = np.cumsum(real - real.mean(axis=0), axis=0)
    return bool(np.sort(run.max(axis=0) - run.min(axis=0))[-2:].sum() * period / len(B) < STILL)


def hidden_couplings(B: Array, period: float, groups: tuple[Group, ...], rounding: Array) -> Array:
    """F = R exp(-1 / r) + rounding (n, n) of modes whose damping crosses: rounds that shrink the coupling R by r end there.

    Source: Berry, Histories of adiabatic quantum transitions, Proc. R. Soc. A 429 (1990).
    """
    apart = group_separation(B, period, groups)
    crossing = apart.outside & np.isinf(apart.oblique)
    left, moved = np.abs(B).max(axis=0), np.abs(circle_derivative(sylvester(B, groups), period)).max(axis=0)
    shrunk = np.exp(-left / np.maximum(moved, 1e-3 * left + np.finfo(float).tiny))
    return np.where(crossing, left * shrunk + rounding, 0)


def catch_up(B: Array, period: float, groups: tuple[Group, ...]) -> Array:
    """exp(g / 2) - 1 with the largest growth g of one mode against another one that grows more over a whole period, (n, n); groups by their
    means."""
    real, size = np.einsum("tii->ti", B).real, [g.size for g in groups]
    mean = np.repeat(np.add.reduceat(real, [g.start for g in groups], axis=1) / size, size, axis=1)
    behind = mean[:, :, None] - mean[:, None, :]
    behind *= -np.sign(behind.mean(axis=0))
    run = np.cumsum(np.concatenate([behind, behind]), axis=0) * period / len(B)
    growth = (run - np.minimum.accumulate(run, axis=0)).max(axis=0)
    return np.asarray(np.expm1(np.minimum(growth, LARGEST) / 2))


def high_harmonics(R: Array, period: float, gap: Array) -> Array:
    """The part of the coupling whose frequencies lie above SLOW_PART of the gap."""
    frequency = 2 * np.pi / period * np.abs(harmonics(len(R)))
    spectrum = np.fft.fft(R, axis=0)
    spectrum[frequency[:, None, None] < SLOW_PART * gap] = 0
    return np.fft.ifft(spectrum, axis=0)
