"""What the coupling that is left between groups of modes does to the exponents."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.circle import harmonics
from flexlin.periodic.decoupling.grouping import Group, block_mask
from flexlin.periodic.decoupling.superadiabatic import sylvester


def pair_effects(B: Array, S: Array, groups: tuple[Group, ...]) -> Array:
    """The largest |B_ij S_ji| of each pair of modes in different groups (n, n), in 1/s: a second-order shift of mode i by mode j."""
    outside = ~block_mask(groups)
    return np.abs(B).max(axis=0) * np.abs(S).max(axis=0).T * outside


def residual_effect(B: Array, period: float, groups: tuple[Group, ...]) -> Array:
    """Bound the generator that the coupling adds to each diagonal block when the other modes are eliminated, entry by entry (n, n).

        d B_kl ~ sum over j outside of  R_kj S_jl,   S of the Sylvester equations

    Where the real parts of two groups stay apart by r, elimination needs no smoothness and costs gap / r more. Elsewhere the
    harmonics of R above half the gap could meet the modes' beat in resonance: they enter at first order, sqrt(|R_kj R_jl|), times what one
    mode may grow against the other within the period.

    Source: Coppel, Dichotomies in Stability Theory (1978), for the first; Yakubovich, Starzhinskii (1975), IV, for the second.
    """
    mask = block_mask(groups)
    S = sylvester(B, groups)
    R = np.where(mask, 0, B)
    X, Z = np.abs(R).max(axis=0), np.abs(S).max(axis=0)
    gap, damping, swing = separations(B, period, groups)
    rough = np.abs(high_harmonics(R, period, gap)).max(axis=0)
    smooth_part = 2 * np.einsum("kj,jl->kjl", X, Z)
    resonant = np.sqrt(np.einsum("kj,jl->kjl", rough, rough)) * swing[:, :, None]
    by_damping = np.einsum("kj,jl->kjl", X, Z) * (gap / np.maximum(damping, 1e-300))[:, :, None]
    return np.minimum(by_damping, smooth_part + resonant).sum(axis=1) * mask


def separations(B: Array, period: float, groups: tuple[Group, ...]) -> tuple[Array, Array, Array]:
    """For each pair of modes: the least gap of their groups, how far real parts stay apart, and the growth against each other."""
    values = np.concatenate([np.linalg.eigvals(B[:, g.part, g.part]) for g in groups], axis=1)
    starts = np.array([g.start for g in groups])
    size = [g.size for g in groups]

    def by_group(pairs: Array, least: np.ufunc) -> Array:
        small = least.reduceat(least.reduceat(pairs, starts, axis=0), starts, axis=1)
        return np.repeat(np.repeat(small, size, axis=0), size, axis=1)

    gap = by_group(np.abs(values[:, :, None] - values[:, None, :]).min(axis=0), np.minimum)
    above = by_group((values.real[:, :, None] - values.real[:, None, :]).min(axis=0), np.minimum)
    damping = np.maximum(0, np.maximum(above, above.T))
    mean = np.repeat(np.add.reduceat(values.real, starts, axis=1) / size, size, axis=1)
    run = np.cumsum(mean - mean.mean(axis=0), axis=0) * period / len(B)
    swing = np.ptp(run[:, :, None] - run[:, None, :], axis=0)
    return gap, damping, np.exp(np.minimum(swing, 600.0))


def high_harmonics(R: Array, period: float, gap: Array) -> Array:
    """The part of the coupling whose frequencies lie above half the gap."""
    frequency = 2 * np.pi / period * np.abs(harmonics(len(R)))
    spectrum = np.fft.fft(R, axis=0)
    spectrum[frequency[:, None, None] < gap / 2] = 0
    return np.fft.ifft(spectrum, axis=0)
