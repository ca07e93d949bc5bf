"""Floquet exponents and modes of systems with fast modes: decoupled first, where that is cheaper than following every oscillation."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError
from flexlin.periodic.circle import assign, match_logs, pair_conjugates, wrap_angle, wrap_log
from flexlin.periodic.coefficient_series.matrix import ResolvedMatrix
from flexlin.periodic.decoupling.coupling import UNRESOLVED_LOG, Decoupled, DecoupledExponents, as_real
from flexlin.periodic.decoupling.decouple import FIRST_NODES
from flexlin.periodic.decoupling.frames import Group, aliasing, block_mask, interpolated, mixing
from flexlin.periodic.floquet.by_segments import SegmentedSpectrum, solve_by_segments
from flexlin.periodic.interpolation import FourierSeries, harmonics, shifted, weigh_harmonics
from flexlin.periodic.product import balance_factors, periodic_vectors
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import FEWER_SEGMENTS, OTHER_WORK, VECTOR_WORK, choose_setting
from flexlin.periodic.transition.factors import gauss_transitions
from flexlin.precision import CUBE_ROOT_EPS, FAINT, FOURTH_ROOT_EPS, LARGEST_LOG_GROWTH, MINOR, ROOT_EPS, SAFETY

GROUP_ANGLE = 0.7
"""The angle by which the members of a complex group are turned, to separate them from their conjugates."""
COUPLING_TURNS = 40
"""In which what is left of the coupling is found to a small part of itself."""


def estimate_decoupling_work(n: int) -> float:
    """Multiplications to decouple n states, as measured: overhead, and eigenvectors and products at the nodes and between them."""
    return 2 * FIRST_NODES * (OTHER_WORK * (40 + 2.4 * n) + 6 * VECTOR_WORK * n**3)


def hide_enclosed(exponents: Array, errors: Array) -> Array:
    """Mark by inf what is only enclosed, if it lies below all that is known: the others keep their enclosures as errors."""
    known = errors <= MINOR * np.maximum(1.0, np.abs(exponents))
    if not known.any():
        return errors
    lowest = float((exponents.real - errors)[known].min())
    return np.where(~known & (exponents.real + errors < lowest), np.inf, errors)


def decoupled_exponents(decoupled: Decoupled, tol: float = 1e-9) -> DecoupledExponents:
    """Floquet exponents of all groups, each with its error.

    A single mode's exponent is the mean of its generator; the nodes that built the frame and those half-way between them give it
    once each, and their difference is its error. A larger group is a small system without fast modes, left to the engine's segments
    (`solve_group`); what couples it to others counts as not known of its coefficients.
    """
    T, n = decoupled.period, decoupled.generator.shape[-1]
    values, errors = np.zeros(n, complex), np.zeros(n)
    single = [i for i, group in enumerate(decoupled.groups) if group.size == 1 and group.partner >= i]
    places = [decoupled.groups[i].start for i in single]
    values[places], errors[places] = singles(decoupled, single)
    for i, group in enumerate(decoupled.groups):
        if group.partner < i:
            mate = decoupled.groups[group.partner].part
            values[group.part], errors[group.part] = values[mate].conj(), errors[mate]
        elif group.size > 1:
            values[group.part], errors[group.part] = solve_group(decoupled, i, tol)
    values = wrap_log(values * T) / T
    order = np.argsort(-values.real, kind="stable")
    return DecoupledExponents(values[order], errors[order])


def singles(decoupled: Decoupled, indices: list[int]) -> tuple[Array, Array]:
    """The exponents (s,) of groups of one, and their errors (s,).

    Where the coupling's bound exceeds what the real parts of the coupled modes `enclose`, the enclosure counts.
    """
    groups = [decoupled.groups[i] for i in indices]
    places = [group.start for group in groups]
    B = decoupled.generator[:, places, places]
    real = np.array([group.partner for group in groups]) == indices
    values = B.mean(axis=0)
    half = np.pi / decoupled.period  # a real mode may turn over within the period
    values = np.where(real, values.real + 1j * half * np.round(values.imag / half), values)
    apart = np.maximum(np.abs(B[::2].mean(axis=0) - B[1::2].mean(axis=0)), aliasing(B))
    coupling = SAFETY * decoupled.residual[places, places]
    loose = coupling * decoupled.period > UNRESOLVED_LOG
    if loose.any():
        low, high = (each[places] for each in decoupled.enclosures)
        reach = np.hypot(np.maximum(high - values.real, values.real - low), np.pi / decoupled.period)
        coupling[loose] = np.minimum(coupling, reach)[loose]
    return values, apart + coupling + SAFETY * decoupled.rounding[places, places]


def solve_group(decoupled: Decoupled, index: int, tol: float) -> tuple[Array, Array]:
    """The exponents (p,) of a group of several modes, and their errors: by segments of its small system, or enclosed.

    Where the group may take the place of others at any time its own equations say nothing; then its enclosure is that of all of them.
    """
    group, T = decoupled.groups[index], decoupled.period
    linked = SAFETY * decoupled.residual[group.part, group.part].max() * T > UNRESOLVED_LOG
    found = None if linked else follow_group(decoupled, index, tol)
    if found is not None and found[1].max() * T < UNRESOLVED_LOG:
        return found
    own, mean = decoupled.traceless(index)
    low, high = (mean.real + bound for bound in bound_growth(own))
    if linked:
        below, above = (each[group.part] for each in decoupled.enclosures)
        low, high = min(low, below.min()), max(high, above.max())
    reach = np.hypot((high - low) / 2, np.pi / T)
    return np.full(group.size, (low + high) / 2 + 1j * mean.imag), np.full(group.size, reach)


def follow_group(decoupled: Decoupled, index: int, tol: float = 1e-9) -> tuple[Array, Array] | None:
    """The exponents (p,) of a group of several modes by segments, and their errors; None where these do not serve.

    A complex one stands there with its conjugates. It is turned by GROUP_ANGLE, which turns these by -GROUP_ANGLE: of the logs, its own
    are those that lie by GROUP_ANGLE above others when turned.
    """
    group, T = decoupled.groups[index], decoupled.period
    own, mean = decoupled.traceless(index)
    tol *= max(1.0, abs(mean.real)) / 2  # what is not known of the coefficients has its part too
    unknown = SAFETY * (decoupled.residual + decoupled.rounding)[group.part, group.part]
    unknown = unknown + aliasing(decoupled.generator[:, group.part, group.part])
    try:
        if decoupled.is_real(index):
            found = solve_series(own, T, unknown, tol)
            logs, errors = pair_conjugates(found.logs, found.errors)
            return mean + logs / T, errors / T
        turn = as_real(1j * GROUP_ANGLE / T * np.eye(group.size))
        both = [solve_series(values, T, np.tile(unknown, (2, 2)), tol) for values in (own + turn, own)]
    except (NumericalError, np.linalg.LinAlgError):
        return None
    logs = both[0].logs - 1j * GROUP_ANGLE
    apart = logs[:, None] - both[1].logs
    miss = np.minimum(np.hypot(apart.real, wrap_angle(apart.imag)), GROUP_ANGLE)
    miss = miss[np.arange(len(logs)), assign(miss)]
    order = np.argsort(miss, kind="stable")[: group.size]
    return (mean + logs[order] / T, both[0].errors[order] / T) if miss[order].max() < GROUP_ANGLE / 4 else None


def solve_series(values: Array, period: float, unknown: Array, tol: float) -> SegmentedSpectrum:
    """Logs of the multipliers of w' = B(t) w from the values of B (N, m, m) at the nodes and what is not known of them (m, m).

    Raises: NumericalError, LinAlgError.
    """
    off = unknown + np.abs(values[1::2] - shifted(values[::2], 0.5)).max(axis=0)
    series = FourierSeries.through(values, period)
    system = PeriodicSystem(series, period)
    vars(system)["resolved"] = ResolvedMatrix(series, (), (), off, len(values), off[None])
    return solve_by_segments(system, choose_setting(system, tol), tol, FEWER_SEGMENTS)


def bound_growth(values: Array) -> tuple[float, float]:
    """Bounds on the real parts of all exponents of w' = B w (N, m, m), in units S in which rows and columns of B are of like size.

        min eig H <= d log |v| / dt <= max eig H,   H = (S^-1 B S + its transpose) / 2

    Source: Coppel (1965), Stability and Asymptotic Behavior of Differential Equations, III.2 (Lozinskii's logarithmic norm).
    """
    even = balance_factors(values)[0]
    ends = np.linalg.eigvalsh((even + np.swapaxes(even, 1, 2)) / 2).mean(axis=0)
    return float(ends[0]), float(ends[-1])


def solve_decoupled_modes(decoupled: Decoupled, exponents: Array) -> tuple[Array, Array] | None:
    """Right and left modes p_i, q_i (N, n, n) at the times of a decoupled system, q_i^H p_i = 1; None where it does not give them well.

        x = T(t) z,   z' = B(t) z,   p_i = T V (e_i + s_i) exp(int d_i dt),   d_i = b_i - lambda_i

    V: the modes of the groups, each of constant exponents; b: the diagonal. What is left of the coupling mixes others in (`correct_modes`).

    Parameters: exponents (n,): in 1/s, in the order of the modes that are wanted.
    """
    period, n = decoupled.period, len(exponents)
    V, own = np.zeros_like(decoupled.generator), np.zeros(n, complex)
    moved = np.zeros((len(decoupled.times), n), complex)
    for i, group in enumerate(decoupled.groups):
        found = follow_block(decoupled, i, group)
        if found is None:
            return None
        own[group.part], V[:, group.part, group.part], moved[:, group.part] = found
    column, apart = match_logs(exponents * period, own * period)
    if not apart.max() < CUBE_ROOT_EPS * max(1.0, float(np.abs(own).max()) * period):
        return None
    k = harmonics(len(moved))
    inside = (k != 0) & (np.abs(k) < len(k) / 2)  # what has an integral at the nodes
    S = correct_modes(decoupled, V, own, moved)
    run = weigh_harmonics(moved, inside / np.where(inside, 2j * np.pi / period * k, 1))
    if S is None or not np.ptp(run.real, axis=0).max() < LARGEST_LOG_GROWTH:
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
    if not errors.max() * period < CUBE_ROOT_EPS:
        return None
    middle, times = exponents.mean(), np.append(decoupled.times, period)
    p, turned = group.size, exponents - middle + 1j * GROUP_ANGLE / period
    values = B + (turned - exponents)[0] * np.eye(p)
    Phi = gauss_transitions(lambda t: as_real(interpolated(values, period, t)), times)
    both, _, known = periodic_vectors(Phi, times, np.append(turned, turned.conj()))
    V = (both[:, :p, :p] + 1j * both[:, p:, :p]) / 2  # [v; -i v] of its own, and nothing of a conjugate's [v; i v]
    if not known[:p].all() or not np.linalg.cond(V).max() < 1 / ROOT_EPS:  # else modes coincide nearly
        return None
    return exponents, V, np.zeros(V.shape[:2])


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
    for _ in range(COUPLING_TURNS):
        before, S = S, weigh_harmonics(R + R @ S + apart * S, over)
        size = np.abs(S).max(axis=0)
        if not np.isfinite(size).all():
            return None
        if np.all(np.abs(S - before).max(axis=0) <= FAINT * (size + size @ size)):
            return S if mixing(S).max() < FOURTH_ROOT_EPS else None
    return None
