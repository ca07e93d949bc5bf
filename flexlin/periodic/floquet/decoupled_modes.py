"""Floquet modes of a decoupled system: the columns of its frame, whatever the frequency of the fastest one."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import assign, measure_distances
from flexlin.periodic.decoupling.decoupled import Decoupled
from flexlin.periodic.decoupling.grouping import Group, block_mask
from flexlin.periodic.decoupling.superadiabatic import harmonics, interpolated
from flexlin.periodic.floquet.decoupled import follow_group
from flexlin.periodic.precision import CUBE, FAINT, FARTHEST, FOURTH, ROOT
from flexlin.periodic.product.cyclic import periodic_vectors
from flexlin.periodic.transition.gauss import gauss_transitions

TURNS = 40
"""In which what is left of the coupling is found to a small part of itself."""


def solve_decoupled_modes(decoupled: Decoupled, exponents: Array) -> tuple[Array, Array] | None:
    """Right and left modes p_i, q_i (N, n, n) at the times of a decoupled system, q_i^H p_i = 1; None where it does not give them well.

        x = T(t) z,   z' = B(t) z,   p_i = T V (e_i + s_i) exp(int d_i dt),   d_i = b_i - lambda_i

    V: the modes of the groups, each of constant exponents; b: the diagonal. What is left of the coupling mixes others in (`correct_modes`).

    Parameters: exponents (n,): in 1/s, in the order of the modes that are wanted.
    """
    period, n = decoupled.period, len(exponents)
    V, own, moved = (
        np.zeros_like(decoupled.generator),
        np.zeros(n, complex),
        np.zeros((len(decoupled.times), n), complex),
    )
    for i, group in enumerate(decoupled.groups):
        found = follow_block(decoupled, i, group)
        if found is None:
            return None
        own[group.part], V[:, group.part, group.part], moved[:, group.part] = found
    apart = measure_distances(exponents * period, own * period)
    column = assign(apart)
    if not apart[np.arange(n), column].max() < CUBE * max(1.0, float(np.abs(own).max()) * period):
        return None
    S, run = correct_modes(decoupled, V, own, moved), integrate_circle(moved, period)
    if S is None or not np.ptp(run.real, axis=0).max() < FARTHEST:
        return None
    plain = decoupled.frame @ V @ (np.eye(n) + S)
    scale = np.exp(run + 1j * (own.imag - exponents[np.argsort(column)].imag) * decoupled.times[:, None])[:, None]
    scale = scale / np.abs(plain * scale).max(axis=(0, 1))
    left = np.swapaxes(np.linalg.inv(plain).conj(), 1, 2) / scale.conj()
    return (plain * scale)[:, :, column], left[:, :, column]


def follow_block(decoupled: Decoupled, index: int, group: Group) -> tuple[Array, Array, Array] | None:
    """Exponents (p,) in 1/s, periodic modes (N, p, p) and deviations of the diagonal (N, p) of one group; None where they are not known."""
    B, period = decoupled.generator[:, group.part, group.part], decoupled.period
    if group.size == 1:
        mean = B[:, 0].mean(axis=0)
        return mean, np.ones_like(B), B[:, 0] - mean
    if group.partner < index:
        found = follow_block(decoupled, group.partner, decoupled.groups[group.partner])
        return None if found is None else (found[0].conj(), found[1].conj(), found[2])
    followed = follow_group(decoupled, index)
    if followed is None:
        return None
    exponents, errors = followed
    if not errors.max() * period < CUBE:
        return None
    middle, times = exponents.mean(), np.append(decoupled.times, period)
    values = B - middle * np.eye(group.size)
    factors = gauss_transitions(lambda t: interpolated(values, period, t), times)
    V, known = periodic_vectors(factors, times, exponents - middle, np.zeros(group.size, int), 1)
    if not known.all() or not np.linalg.cond(V).max() < 1 / ROOT:  # else modes coincide nearly
        return None
    return exponents, V, np.zeros(V.shape[:2])


def integrate_circle(values: Array, period: float) -> Array:
    """The integral of values (N, n) without mean at equidistant times of a period."""
    k = harmonics(len(values))[:, None]
    inside = (k != 0) & (np.abs(k) < len(values) / 2)
    spectrum = np.fft.fft(values, axis=0) * inside / np.where(inside, 2j * np.pi / period * k, 1)
    return np.asarray(np.fft.ifft(spectrum, axis=0))


def correct_modes(decoupled: Decoupled, V: Array, own: Array, moved: Array) -> Array | None:
    """s (N, n, n), zero inside the groups, from what is left of the coupling; None where it is no small correction.

        s' = diag(lambda + d) s - s diag(lambda + d) + R (1 + s),   R = V^-1 (B - blocks) V,   in turns that put d and R s on the right

    Source: Yakubovich, Starzhinskii, Linear Differential Equations with Periodic Coefficients (1975), IV (first order).
    """
    B, mask = decoupled.generator, block_mask(decoupled.groups)
    R = np.linalg.solve(V, np.where(mask, 0, B) @ V)
    k = 2 * np.pi / decoupled.period * harmonics(len(B))[:, None, None]
    over = np.where(mask, 0, 1 / np.where(mask, 1, 1j * k + own - own[:, None]))
    apart, S = moved[:, :, None] - moved[:, None], np.zeros_like(R)
    for _ in range(TURNS):
        before, S = S, np.fft.ifft(over * np.fft.fft(R + R @ S + apart * S, axis=0), axis=0)
        size = np.abs(S).max(axis=0)
        if not np.isfinite(size).all():
            return None
        if np.all(np.abs(S - before).max(axis=0) <= FAINT * (size + size @ size)):
            return S if measure_mixing(S) < FOURTH else None
    return None


def measure_mixing(S: Array) -> float:
    """How far 1 + s mixes two modes at most, whatever their scaling."""
    size = np.abs(S).max(axis=0)
    return float(np.sqrt(size * size.T).max())
