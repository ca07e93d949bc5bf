"""Floquet exponents of a decoupled system, each with its error."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.assignment import assign
from flexlin.periodic.circle import match_logs, pair_conjugates, wrap_angle, wrap_log
from flexlin.periodic.decoupling.coupling import group_separation
from flexlin.periodic.decoupling.decoupled import Decoupled, as_real
from flexlin.periodic.decoupling.tame import tame_exponents
from flexlin.periodic.decoupling.waves import aliasing, interpolated
from flexlin.periodic.product.balancing import balance_factors
from flexlin.periodic.product.eigenvalues import product_logs, solve_product
from flexlin.periodic.transition.gauss import gauss_transitions

STAGES, STEP = 8, 2.0
"""Gauss stages, and the largest product of a step and an eigenvalue: the error of a step is then 1e-14."""
COARSER = 2 / 3
"""A second integration on this part of the segments measures the error of the first."""
FEW, MOST, RESOLVED = 500, 4000, 300.0
"""Larger groups that need more segments than MOST, or than FEW while their modes part by more than exp(RESOLVED) in a period, are
only enclosed."""
UNRESOLVED = 0.5
"""Logs of multipliers with larger errors are ill-conditioned beyond measuring; their group is only enclosed."""
SAFETY = 3.0
MARK = 0.7
"""The angle by which the members of a complex group are turned, to separate them from their conjugates."""


@dataclass(frozen=True)
class DecoupledExponents:
    """Exponents (n,) in 1/s by falling real part, imaginary parts in (-pi/T, pi/T], and their errors (n,).

    discretization, coupling, rounding (n,): the parts of the errors; of larger groups all three stand in `discretization`.
    """

    exponents: Array
    errors: Array
    discretization: Array
    coupling: Array
    rounding: Array


def decoupled_exponents(decoupled: Decoupled, tame_only: bool = False) -> DecoupledExponents:
    """Floquet exponents of all groups.

    A single mode's exponent is the mean of its generator; the nodes that built the frame and those half-way between them give it
    once each, and their difference is its error. A larger group is a small system without fast modes, integrated by Gauss collocation:
    its error is bounded by perturbation theory where its modes grow little against each other (`tame_exponents`). Elsewhere it is its
    motion under coarser steps, under the generator of one set of nodes alone, and under a random perturbation of the size of the
    residual coupling and of the rounding; with `tame_only` it is infinite there.
    """
    n, period = decoupled.generator.shape[-1], decoupled.period
    values, parts = np.zeros(n, complex), np.zeros((3, n))
    single = [i for i, group in enumerate(decoupled.groups) if group.size == 1 and group.partner >= i]
    places = [decoupled.groups[i].start for i in single]
    values[places], parts[:, places] = singles(decoupled, single)
    for i, group in enumerate(decoupled.groups):
        if group.partner < i:
            mate = decoupled.groups[group.partner].part
            values[group.part], parts[:, group.part] = values[mate].conj(), parts[:, mate]
        elif group.size > 1:
            with np.errstate(over="ignore", invalid="ignore"):  # what overflows comes out unresolved and is enclosed
                values[group.part], parts[0, group.part] = several(decoupled, i, tame_only)
    values = wrap_log(values * period) / period
    order = np.argsort(-values.real, kind="stable")
    discretization, coupling, rounding = parts[:, order]
    return DecoupledExponents(values[order], parts.sum(axis=0)[order], discretization, coupling, rounding)


def singles(decoupled: Decoupled, indices: list[int]) -> tuple[Array, Array]:
    """The exponents (s,) of groups of one, and their three errors (3, s).

    Where the coupling's bound exceeds what the real parts of the coupled modes enclose, the enclosure counts.
    """
    groups = [decoupled.groups[i] for i in indices]
    places = [group.start for group in groups]
    B = decoupled.generator[:, places, places]
    real = np.array([group.partner for group in groups]) == indices
    values = B.mean(axis=0)
    values = np.where(real, values.real + 1j * np.pi / decoupled.period * decoupled.turning[indices], values)
    apart = np.maximum(np.abs(B[::2].mean(axis=0) - B[1::2].mean(axis=0)), aliasing(B))
    coupling = SAFETY * decoupled.residual[places, places]
    for i in np.flatnonzero(coupling * decoupled.period > UNRESOLVED).tolist():
        coupling[i] = min(coupling[i], enclosure(decoupled, places[i]))
    return values, np.array([apart, coupling, SAFETY * decoupled.rounding[places, places]])


def enclosure(decoupled: Decoupled, k: int) -> float:
    """How far the exponent of mode k may lie from its mean when the modes whose damping crosses its own may take its place at any time."""
    B, groups = decoupled.generator, decoupled.groups
    apart = group_separation(B, decoupled.period, groups)
    crossing = apart.outside[k] & np.isinf(apart.oblique[k])
    real = np.concatenate([np.linalg.eigvals(B[:, g.part, g.part]).real for g in groups], axis=1)
    reach = np.abs(real - B[:, k, k].real[:, None])[:, crossing].max(axis=1, initial=0.0).mean()
    return float(np.hypot(reach, np.pi / decoupled.period))


def several(decoupled: Decoupled, index: int, tame_only: bool = False) -> tuple[Array, Array]:
    """The exponents of a larger group, and their errors."""
    group, period = decoupled.groups[index], decoupled.period
    values, mean = decoupled.traceless(index)
    complex_group = group.partner != index
    tame = None if complex_group else tame_exponents(values, period, find_unknown(decoupled, index))
    if tame is not None:
        logs, errors = pair_conjugates(*tame)
        return mean + logs / period, errors / period
    if tame_only:
        return np.full(group.size, mean), np.full(group.size, np.inf)
    segments, spread = group_segments(values, period)
    if segments > MOST or (segments > FEW and spread > RESOLVED):
        return bounded(values, mean, group.size, period)
    coarse = max(1, round(COARSER * segments))
    shift = perturbation(decoupled, index)
    logs, rounding = solve_product(factor_group(values, period, segments))
    other = product_logs(factor_group(values, period, coarse))
    moved = product_logs(factor_group(values[::2] + shift, period, coarse))
    partner, apart = match_logs(logs, other)
    errors = 2 * rounding + apart + SAFETY * match_logs(other, moved)[1][partner]
    if not errors.max() < UNRESOLVED:
        return bounded(values, mean, group.size, period)
    if complex_group:
        own, missed = members(values, period, coarse, logs)
        if missed > MARK / 4:
            return bounded(values, mean, group.size, period)
        logs, errors = logs[own], errors[own]
    else:
        logs, errors = pair_conjugates(logs, errors)
    return mean + logs / period, errors / period


def find_unknown(decoupled: Decoupled, index: int) -> Array:
    """What is not known of a group's generator, entry by entry (p, p): the coupling's effect, rounding and missing harmonics."""
    part = decoupled.groups[index].part
    known = decoupled.generator[:, part, part]
    return SAFETY * (decoupled.residual + decoupled.rounding)[part, part] + aliasing(known)


def perturbation(decoupled: Decoupled, index: int) -> Array:
    """A random generator as large as what is not known of a group's: the coupling's effect, rounding and missing harmonics."""
    group = decoupled.groups[index]
    known = decoupled.generator[:, group.part, group.part]
    size = (decoupled.residual + 10 * decoupled.rounding)[group.part, group.part] + aliasing(known)
    rng = np.random.default_rng(20190610)
    if group.partner == index:
        return size * rng.choice([-1.0, 1.0], size.shape)
    return as_real(size * np.exp(2j * np.pi * rng.random(size.shape)))


def group_segments(values: Array, period: float) -> tuple[int, float]:
    """Segments that resolve the eigenvalues of the generator and its harmonics, and the spread of the real parts over a period."""
    eigenvalues = np.linalg.eigvals(values)
    rate = float(np.abs(eigenvalues).max())
    spread = float(np.ptp(eigenvalues.real, axis=1).mean()) * period
    return max(len(values) // 16, int(np.ceil(period * rate / STEP))), spread


def bounded(values: Array, mean: complex, size: int, period: float) -> tuple[Array, Array]:
    """Enclose the exponents of a group by the numerical range of its generator: real parts up to the mean of max eig (B + B') / 2.

    Source: Coppel (1965), Stability and Asymptotic Behavior of Differential Equations, III.2 (Lozinskii's logarithmic norm).
    """
    scale = balance_factors(values)[1]
    even = values * (scale / scale[:, None])
    reach = np.abs(np.linalg.eigvalsh((even + np.swapaxes(even, 1, 2)) / 2)).max(axis=1).mean()
    return np.full(size, mean), np.full(size, float(np.hypot(reach, np.pi / period)))


def factor_group(values: Array, period: float, segments: int) -> Array:
    """Transition matrices of w' = values(t) w over equal segments of the period."""
    return gauss_transitions(lambda t: interpolated(values, period, t), np.linspace(0, period, segments + 1), STAGES)


def members(values: Array, period: float, segments: int, logs: Array) -> tuple[Array, float]:
    """Which logs of a complex group in real form are its own and not their conjugates (p,): those that a turn by MARK moves up.

    Also returns how far the worst of them misses the turned spectrum.
    """
    half = values.shape[-1] // 2
    turn = as_real(1j * MARK / period * np.eye(half))
    turned = product_logs(factor_group(values + turn, period, segments))
    apart = logs[:, None] + 1j * MARK - turned
    miss = np.minimum(np.hypot(apart.real, wrap_angle(apart.imag)), MARK)
    row, column = np.arange(len(miss)), assign(miss)
    order = np.argsort(miss[row, column], kind="stable")[:half]
    return row[order], float(miss[row, column][order].max())
