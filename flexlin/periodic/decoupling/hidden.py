"""What couplings that nobody can see do to the exponents of modes that take turns in being damped less."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.decoupling.coupling import Coupled, high_harmonics

STILL = 8.0
"""Modes that grow by less than exp(STILL) against each other within a period do not bring out what is hidden."""
LINKED = 1e-3
"""Modes whose multipliers are moved less by each other do not take each other's place."""


def hidden_effect(coupled: Coupled, rounding: Array) -> Array:
    """Bound what couplings that no round can take away add to each diagonal block, entry by entry (n, n), where damping crosses.

        d lambda_i ~ c^2 / max(|lambda_i - lambda_j|, c),   c^2 = F_ij F_ji exp(g_ij)

    A mode that falls behind another by exp(g) and catches up again follows the other one in between, if as little as exp(-g / 2) of it
    goes over and comes back, however smooth A is.

    Parameters: rounding (n, n): of the generator's entries, in 1/s.
    Source: Berry, Uzdin, Slow non-Hermitian cycling, J. Phys. A 44 (2011), 435303.
    """
    total = np.zeros(rounding.shape)
    B, period, groups = coupled.B, coupled.period, coupled.groups
    if find_growth(B, period) < STILL:
        return total
    F, caught_up = hidden_couplings(coupled, rounding), coupled.catch_up
    logs = np.einsum("tii->ti", B).mean(axis=0) * period
    single = np.concatenate([np.full(g.size, g.size == 1) for g in groups])
    gap = np.where(single[:, None] & single, measure_distances(logs, logs) / period, 0)
    for g in groups:
        size = np.sqrt(np.einsum("kj,jl->kjl", F[g.part], F[:, g.part])) * caught_up[g.part, :, None]
        share = size / np.maximum(np.maximum(gap[g.part, :, None], size), np.finfo(float).tiny)
        total[g.part, g.part] = (size * share).sum(axis=1)
    return total


def link_modes(coupled: Coupled, rounding: Array) -> Array:
    """Pairs of modes (n, n) of which one may go over to the other and come back, as far as anybody can see."""
    apart = coupled.apart
    rough = np.abs(high_harmonics(coupled.B, coupled.period, apart.crossing)).max(axis=0)
    with np.errstate(invalid="ignore"):
        seen = np.sqrt(rough * rough.T) * apart.swing
    F = hidden_couplings(coupled, rounding)
    linked = np.maximum(seen, np.sqrt(F * F.T) * coupled.catch_up) * coupled.period > LINKED
    return np.asarray(linked & apart.outside & np.isinf(apart.oblique))


def find_growth(B: Array, period: float) -> float:
    """The logarithm by which two modes may grow against each other within the period."""
    real = B.reshape(len(B), -1)[:, :: B.shape[-1] + 1].real
    run = np.cumsum(real - real.mean(axis=0), axis=0)
    return float(np.sort(run.max(axis=0) - run.min(axis=0))[-2:].sum() * period / len(B))


def hidden_couplings(coupled: Coupled, rounding: Array) -> Array:
    """F = R exp(-1 / r) + rounding (n, n) of modes whose damping crosses: rounds that shrink the coupling R by r end there.

    Source: Berry, Histories of adiabatic quantum transitions, Proc. R. Soc. A 429 (1990).
    """
    crossing = coupled.apart.outside & np.isinf(coupled.apart.oblique)
    shrunk = np.exp(-coupled.size / np.maximum(coupled.moved, 1e-3 * coupled.size + np.finfo(float).tiny))
    return np.where(crossing, coupled.size * shrunk + rounding, 0)
