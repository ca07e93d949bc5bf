"""Exponents of a group of several modes: a small system without fast modes, whose errors follow from left and right Floquet vectors."""

from collections.abc import Callable
from math import log
from typing import NamedTuple

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.assignment import assign
from flexlin.periodic.circle import pair_conjugates, wrap_angle, wrap_log
from flexlin.periodic.decoupling.decoupled import Decoupled, as_real
from flexlin.periodic.decoupling.group_factors import COARSE, FINE, FINER, METHOD, GroupSeries, fit_group
from flexlin.periodic.decoupling.tame import LARGEST_GROWTH, tame_exponents
from flexlin.periodic.decoupling.waves import aliasing, shifted
from flexlin.periodic.product.balancing import balance_factors
from flexlin.periodic.product.spectrum import Unknown, find_spectrum, product_logs

GROWTH, WANTED, LONGEST, WAVES = 1e-10, 0.06, 1.0, 10
"""The error of a log as measured: this times the fastest rate times the period, times the sixth power of the rate times a part's length.
The part of tol that it may take, the longest part's product with the rate, and how many times the basic frequency adds to the rate."""
LARGEST, AIM = 0.6, 0.2
"""The part of tol that the method's error may take before segments are made finer, twice at the most, and the part then aimed at."""
FEW, MOST, RESOLVED, DEAR = 500, 6000, 300.0, 5e6
"""Larger groups are only enclosed that need more segments than MOST; or while their modes part by more than exp(RESOLVED) in a period, so
many that times the third power of the states they exceed DEAR, complex groups more than FEW: their modes mostly take turns then."""
WILD = 2 * log(LARGEST_GROWTH)
"""Modes of which the eigenvalues part by more within a period, in logarithms, are not tame."""
UNRESOLVED = 0.5
"""Logs of multipliers with larger errors are ill-conditioned beyond measuring; their group is only enclosed."""
SAFETY = 3.0
"""Factor on the coupling's effect and rounding."""
SHORT = 10.0
"""Condition number up to which factors are multiplied: the Floquet vectors change little over each product."""
SPARSE = 4
"""Rates are sought at every so many nodes."""
MARK = 0.7
"""The angle by which the members of a complex group are turned, to separate them from their conjugates."""


class Logs(NamedTuple):
    """Logs of multipliers, and how far they may lie off by the method and for other reasons, (p,) each."""

    logs: Array
    method: Array
    rest: Array


def several(decoupled: Decoupled, index: int, tol: float = 1e-9) -> tuple[Array, Array]:
    """The exponents of a larger group, and their errors."""
    group, period = decoupled.groups[index], decoupled.period
    values, mean = decoupled.traceless(index)
    real = group.partner == index
    unknown = find_unknown(decoupled, index)
    segments, spread = group_segments(values, period, mean, tol)
    allowed = tol * period * max(1.0, abs(mean.real))
    tame = tame_exponents(values, period, unknown, allowed) if real and spread < WILD else None
    if tame is not None:
        logs, errors = pair_conjugates(*tame)
        return mean + logs / period, errors / period
    most = min(MOST, DEAR / group.size**3 if real else FEW) if spread > RESOLVED else MOST
    if segments > most:
        return bounded(values, mean, group.size, period)
    follow: Callable[[Array, float, int, Array], Logs | None] = follow_real if real else follow_complex
    for _ in range(3):
        found = follow(values, period, segments, unknown)
        errors = np.full(group.size, np.inf) if found is None else found.method + found.rest
        if found is None or not errors.max() < UNRESOLVED:
            return bounded(values, mean, group.size, period)
        exponents = mean + found.logs / period
        folded = np.abs(mean.real + wrap_log(found.logs) / period)
        share = float((found.method / (tol * period * np.maximum(1, folded))).max())
        if share < LARGEST:
            break
        segments = min(MOST, int(np.ceil(segments * (share / AIM) ** (1 / 6))))
    return exponents, errors / period


def find_unknown(decoupled: Decoupled, index: int) -> Array:
    """What is not known of a group's generator, entry by entry (p, p): the coupling's effect, rounding and missing harmonics."""
    part = decoupled.groups[index].part
    known = decoupled.generator[:, part, part]
    return SAFETY * (decoupled.residual + decoupled.rounding)[part, part] + aliasing(known)


def follow_real(values: Array, period: float, segments: int, unknown: Array) -> Logs:
    """Logs of the multipliers of a real group without trace, conjugates exactly."""
    series = fit_balanced(values, period, unknown, 1)
    plain, better = (series.factor(segments, parts) for parts in (FINE, COARSE))
    found = group_logs(plain, better, series)
    logs, errors = pair_conjugates(found.logs, found.method + found.rest)
    return Logs(logs, found.method, errors - found.method)


def follow_complex(values: Array, period: float, segments: int, unknown: Array) -> Logs | None:
    """The same of a complex group in real form, (2p, 2p), its conjugates left out; None where these cannot be set apart.

    The group is turned by MARK, its conjugates by -MARK: of the logs, its own are those that lie by MARK above others when turned.
    """
    p = len(unknown)
    series = fit_balanced(values, period, np.tile(unknown, (2, 2)), 2)
    turn = as_real(np.exp(1j * MARK / segments) * np.eye(p))
    factors = [series.factor(segments, parts) for parts in (FINE, COARSE)]
    turned = group_logs(turn @ factors[0], turn @ factors[1], series)
    logs = turned.logs - 1j * MARK
    apart = logs[:, None] - product_logs(factors[0])
    miss = np.minimum(np.hypot(apart.real, wrap_angle(apart.imag)), MARK)
    row, column = np.arange(2 * p), assign(miss)
    order = np.argsort(miss[row, column], kind="stable")[:p]
    if miss[row, column][order].max() > MARK / 4:
        return None
    return Logs(logs[order], turned.method[order], turned.rest[order])


def fit_balanced(values: Array, period: float, unknown: Array, copies: int) -> GroupSeries:
    """The series of a generator at the nodes, in units of its states that even out rows and columns, alike for all `copies` of these.

    What the nodes half-way between differ by from the interpolant of the others is not known either.
    """
    m = values.shape[-1]
    off = unknown + np.abs(values[1::2] - shifted(values[::2], 0.5)).max(axis=0)
    size = np.abs(values).reshape(-1, copies, m // copies, copies, m // copies).sum(axis=(1, 3))
    scale = np.tile(balance_factors(size)[1], copies)
    return fit_group(values * (scale / scale[:, None]), period, off * (scale / scale[:, None]))


def group_logs(plain: Array, better: Array, series: GroupSeries) -> Logs:
    """Logs of the multipliers of w' = B(t) w from its factors (K, m, m) over equal segments.

        |d log mu_i| <= int over the period of  |l_i| dB |r_i|,   l_i r_i = 1

    to first order, for the generator's worst perturbation dB of the size that is not known, and by what `better` factors change: FINER
    says how much of that counts. Neighbours and clusters add what they do to each other (`find_spectrum`).
    """
    unknown = np.broadcast_to(series.period / len(plain) * series.unknown, plain.shape)
    found = find_spectrum(plain, better, Unknown(unknown), each=FINE, limit=SHORT)
    return Logs(found.logs, METHOD * FINER * found.method, found.rounding)


def group_segments(values: Array, period: float, mean: complex, tol: float) -> tuple[int, float]:
    """Segments on which the factors meet tol and pass over no harmonics, and the spread of the real parts over a period."""
    eigenvalues = np.linalg.eigvals(values[::SPARSE])
    rate = float(np.abs(eigenvalues).max()) + WAVES * 2 * np.pi / period
    allowed = WANTED * tol * max(1.0, float(np.abs((mean + eigenvalues).real).min()))
    part = min(LONGEST, (allowed / (GROWTH * max(rate, allowed))) ** (1 / 6))
    spread = float(np.ptp(eigenvalues.real, axis=1).mean()) * period
    return max(len(values) // 16, int(np.ceil(period * rate / (FINE * part)))), spread


def bounded(values: Array, mean: complex, size: int, period: float) -> tuple[Array, Array]:
    """Enclose the exponents of a group by the numerical range of its generator, from above and from below: middle and half width.

    Source: Coppel (1965), Stability and Asymptotic Behavior of Differential Equations, III.2 (Lozinskii's logarithmic norm).
    """
    low, high = bound_growth(values, period)
    return np.full(size, mean + (low + high) / 2), np.full(size, float(np.hypot((high - low) / 2, np.pi / period)))


def bound_growth(values: Array, period: float) -> tuple[float, float]:
    """Bounds on the real parts of all exponents of w' = B w (N, m, m), w = S v, S diagonal or eigenvectors at the nodes.

        min eig H <= d log |v| / dt <= max eig H,   H = (S^-1 B S + its transpose) / 2

    |v| grows by |S_(k+1)^-1 S_k| from one node's coordinates to the next.
    """
    scale = balance_factors(values)[1]
    even = values * (scale / scale[:, None])
    plain, turned = (logarithmic_norms(even, period, vectors) for vectors in (None, np.linalg.eig(even)[1]))
    return max(plain[0], turned[0]), min(plain[1], turned[1])


def logarithmic_norms(values: Array, period: float, vectors: Array | None = None) -> tuple[float, float]:
    """Bounds on the real parts of all exponents, from the coordinates of `vectors` (N, m, m) at the nodes if there are any."""
    if vectors is None:
        plain = np.linalg.eigvalsh((values + np.swapaxes(values, 1, 2)) / 2)
        return float(plain[:, 0].mean()), float(plain[:, -1].mean())
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return -np.inf, np.inf
    turned = np.roll(inverse, -1, axis=0) @ vectors
    ends = []
    for B in (values, np.roll(values, -1, axis=0)):
        own = inverse @ B @ vectors
        ends.append(np.linalg.eigvalsh((own + np.conj(np.swapaxes(own, 1, 2))) / 2))
    crossed = np.log(
        np.maximum(np.linalg.norm(turned, 2, axis=(1, 2)), np.linalg.norm(np.linalg.inv(turned), 2, axis=(1, 2)))
    )
    more, (low, high) = crossed.sum() / period, (np.minimum(*ends)[:, 0].mean(), np.maximum(*ends)[:, -1].mean())
    return float(low - more), float(high + more)
