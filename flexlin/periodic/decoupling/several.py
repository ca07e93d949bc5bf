"""Exponents of a group of several modes: a small system without fast modes, whose errors follow from left and right Floquet vectors."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.assignment import assign
from flexlin.periodic.circle import pair_conjugates, wrap_angle
from flexlin.periodic.decoupling.decoupled import Decoupled, as_real
from flexlin.periodic.decoupling.tame import tame_exponents
from flexlin.periodic.decoupling.waves import aliasing, interpolated, shifted
from flexlin.periodic.product.balancing import balance_factors, count_groupings, multiply_pairs
from flexlin.periodic.product.eigenvalues import product_logs
from flexlin.periodic.product.perturbation import COHERENT, spectrum_motion
from flexlin.periodic.product.schur import periodic_schur
from flexlin.periodic.transition.gauss import gauss_transitions

STAGES, MORE, STEP = 8, 2, 2.0
"""Gauss stages, how many more the better factors have that measure their error, and the largest product of a step and an eigenvalue."""
FEW, MOST, RESOLVED = 500, 4000, 300.0
"""Larger groups that need more segments than MOST, or than FEW while their modes part by more than exp(RESOLVED) in a period, are
only enclosed."""
UNRESOLVED = 0.5
"""Logs of multipliers with larger errors are ill-conditioned beyond measuring; their group is only enclosed."""
SAFETY, METHOD = 3.0, 2.0
"""Factors on the coupling's effect and rounding, and on the method's error."""
SHORT = 10.0
"""Condition number up to which factors are multiplied: the Floquet vectors change little over each product."""
MARK = 0.7
"""The angle by which the members of a complex group are turned, to separate them from their conjugates."""


def several(decoupled: Decoupled, index: int, tame_only: bool = False) -> tuple[Array, Array]:
    """The exponents of a larger group, and their errors; with `tame_only` these are infinite where the group is not tame."""
    group, period = decoupled.groups[index], decoupled.period
    values, mean = decoupled.traceless(index)
    complex_group = group.partner != index
    unknown = find_unknown(decoupled, index)
    tame = None if complex_group else tame_exponents(values, period, unknown)
    if tame is not None:
        logs, errors = pair_conjugates(*tame)
        return mean + logs / period, errors / period
    if tame_only:
        return np.full(group.size, mean), np.full(group.size, np.inf)
    segments, spread = group_segments(values, period)
    if segments > MOST or (segments > FEW and spread > RESOLVED):
        return bounded(values, mean, group.size, period)
    if complex_group:
        turn = as_real(1j * MARK / period * np.eye(group.size))
        logs, errors = group_logs(values + turn, period, segments, np.tile(unknown, (2, 2)))
        logs, errors, missed = members(values, period, segments, logs, errors)
    else:
        logs, errors = pair_conjugates(*group_logs(values, period, segments, unknown))
        missed = 0.0
    if not errors.max() < UNRESOLVED or missed > MARK / 4:
        return bounded(values, mean, group.size, period)
    return mean + logs / period, errors / period


def find_unknown(decoupled: Decoupled, index: int) -> Array:
    """What is not known of a group's generator, entry by entry (p, p): the coupling's effect, rounding and missing harmonics."""
    part = decoupled.groups[index].part
    known = decoupled.generator[:, part, part]
    return SAFETY * (decoupled.residual + decoupled.rounding)[part, part] + aliasing(known)


def group_logs(values: Array, period: float, segments: int, unknown: Array) -> tuple[Array, Array]:
    """Logs of the multipliers of w' = values(t) w and how far they may lie off (m,).

        |d log mu_i| <= int over the period of  |l_i| dB |r_i|,   l_i r_i = 1

    to first order, for the generator's worst perturbation of the size dB: `unknown`, and what the nodes half-way between differ by from
    the interpolant of the others. Neighbours and clusters add what they do to each other (`spectrum_motion`).

    Parameters: values (N, m, m), real, at the nodes k T / N, N even; unknown (m, m), in 1/s.
    """
    between = values[1::2] - shifted(values[::2], 0.5)
    size = unknown + np.abs(between).max(axis=0)
    plain, better = (factor_group(values, period, segments, STAGES + more) for more in (0, MORE))
    even, scale = balance_factors(plain)
    groups, rounds = count_groupings(even, SHORT)
    better, marks = better * (scale / scale[:, None]), np.linspace(0, period, segments + 1)
    for _ in range(rounds):
        better, marks = multiply_pairs(better), np.append(marks[:-1:2], marks[-1])
    lengths = np.diff(marks)[:, None, None] / (COHERENT * 2.0**rounds)  # so that all of it adds up with one sign

    def noise(left: Array, right: Array) -> Array:
        return lengths * (np.abs(left / scale) @ size @ np.abs(scale[:, None] * right))

    form = periodic_schur(groups)
    motion = spectrum_motion(form, groups, better, noise, 2.0**rounds)
    order = np.argsort(-form.logs.real, kind="stable")
    return form.logs[order], (METHOD * motion.method + motion.rounding)[order]


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


def factor_group(values: Array, period: float, segments: int, stages: int = STAGES) -> Array:
    """Transition matrices of w' = values(t) w over equal segments of the period."""
    return gauss_transitions(lambda t: interpolated(values, period, t), np.linspace(0, period, segments + 1), stages)


def members(values: Array, period: float, segments: int, turned: Array, errors: Array) -> tuple[Array, Array, float]:
    """Which logs of a turned complex group in real form are its own and not their conjugates: those that lie by MARK above others.

    Returns: its own logs, turned back, and their errors (p,); how far the worst of them misses the spectrum that is not turned.
    """
    logs = turned - 1j * MARK
    apart = logs[:, None] - product_logs(factor_group(values, period, segments))
    miss = np.minimum(np.hypot(apart.real, wrap_angle(apart.imag)), MARK)
    row, column = np.arange(len(miss)), assign(miss)
    order = np.argsort(miss[row, column], kind="stable")[: len(miss) // 2]
    own = row[order]
    return logs[own], errors[own], float(miss[row, column][order].max())
