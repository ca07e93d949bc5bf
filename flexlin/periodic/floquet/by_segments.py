"""Floquet exponents from the transition matrices of segments, with the error of the method and of rounding."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import match_logs
from flexlin.periodic.interpolation import FINER_BOUNDS, NODES
from flexlin.periodic.product import ProductSpectrum, Unknown, find_spectrum
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.choose_segments import (
    FEWER_SEGMENTS,
    Setting,
    factor_twice,
    place_segments,
    report_too_many,
)
from flexlin.precision import CUBE_ROOT_EPS, EPS, FAINT, ROOT_EPS, SLIGHT

METHOD_SAFETY = 2.0
"""Factor on the method's error, which is measured against a better method."""
SHARED_ERROR = 0.003
"""Part of the worst mode's error, relative to what is allowed, that every mode is given: a small one may be so by accident."""
LOST_ERROR = 1e-2
"""A mode whose error exceeds this part of its size is not followed at all, and says nothing of the others."""
RADAU_TURN, LOOK_SEGMENTS = 2.0, 256
"""Radians by which a mode may turn in a segment of Radau's method, and segments at which the eigenvalues of A(t) are looked at."""
EXTINCT_DECAY = -float(np.log(EPS))
"""Decay over a period, beside that of the slowest mode, after which rounding hides what is left."""
HELPED_PART = 0.7
"""Where rounding alone makes segments shorter: the part of it that half as long ones leave at the most."""


@dataclass(frozen=True)
class SegmentedSpectrum:
    """Logs of the multipliers (n,) by falling real part, their errors (n,), inf where unresolved, and rounding's part in these.

    start (n, n): the bases of the slowest modes, from which a finer resolution begins; stretched: shorter segments would round less.
    """

    logs: Array
    errors: Array
    rounding: Array
    setting: Setting
    start: Array
    stretched: bool = False


Factored = tuple[list[Array], Array, Unknown]
"""The factors of a period by a method and a better one, h A at their beginnings, and what is not known over each."""


def solve_by_segments(
    system: PeriodicSystem,
    setting: Setting,
    tol: float,
    max_segments: int,
    fixed: bool = False,
) -> SegmentedSpectrum:
    """Refine the segments until the errors of all exponents are below tol, or rounding or max_segments allow no more.

    The first bases are those of no system; where rounding hides more than tol, they are found once more from where they ended. Where
    nothing is known of some modes in the end, those above them stand apart.

    Parameters: tol: wanted error of an exponent, relative beyond 1/s; fixed: take the setting as it is.
    Raises: TooManySegments, where many more seem to be needed.
    """
    most = int(np.ceil(FINER_BOUNDS[0] * max_segments))
    if setting.segments > most:
        raise report_too_many(setting.segments, max_segments, tol)
    setting = replace(setting, segments=min(setting.segments, max_segments))
    start, before, refined, factored, part = None, np.inf, False, None, False
    while True:
        factored = factored or factor_twice(system, setting)
        spectrum, method = find_exponents_with_errors(system, setting, factored, start, part)
        wanted = tol * np.maximum(system.period, np.abs(spectrum.logs)) / METHOD_SAFETY
        if setting.method == "radau":
            spectrum = bound_extinct(spectrum, method > wanted)
        resolved = np.isfinite(spectrum.errors)
        noise = (METHOD_SAFETY if refined else 1.0) * spectrum.rounding  # below it, rounding alone may stand
        excess = float((method / np.maximum(wanted, noise))[resolved].max(initial=0.0))
        if start is None and (spectrum.rounding > wanted)[resolved].any():
            start = spectrum.start
            continue
        rounded = float((spectrum.rounding / wanted)[resolved].max(initial=0.0))
        twice = 2 * setting.segments
        may_help = spectrum.stretched and not fixed and twice <= min(max_segments, FEWER_SEGMENTS)
        if may_help and 1 < rounded < HELPED_PART * before:
            setting, start, before, factored = replace(setting, segments=twice), spectrum.start, rounded, None
            continue
        finer = np.clip(1.1 * excess ** (1 / setting.order), *FINER_BOUNDS) if np.isfinite(excess) else FINER_BOUNDS[1]
        count = int(np.ceil(setting.segments * finer))
        done = fixed or excess <= 1 or (setting.segments == max_segments and count <= most)
        if (done or count > most) and not part and (spectrum.errors > 1)[resolved].any():
            start, part = spectrum.start, True
            continue
        if done:
            noisy = not fixed and bool((method > wanted)[resolved].any()) and setting.segments < max_segments
            return add_blind(compare_noise(system, spectrum) if noisy else spectrum, system, tol)
        if count > most:
            raise report_too_many(count, max_segments, tol)
        setting = replace(setting, segments=min(count, max_segments))
        start, refined, factored = spectrum.start, True, None


def bound_extinct(spectrum: SegmentedSpectrum, missed: Array) -> SegmentedSpectrum:
    """Ask no digits of modes from the first of (n,) that missed what was wanted and of which nothing is left after a period.

    By an L-stable method they decay beside the slowest one, however long the segments are; to follow them would take most of these.
    """
    below = spectrum.logs.real[0] - spectrum.logs.real
    extinct = missed & (below > max(EXTINCT_DECAY, spectrum.errors[0]))
    return replace(spectrum, errors=np.where(np.logical_or.accumulate(extinct), np.inf, spectrum.errors))


def add_blind(spectrum: SegmentedSpectrum, system: PeriodicSystem, tol: float) -> SegmentedSpectrum:
    """Add to the errors what both methods may miss alike at the ends of narrow panels, where neither has a node."""
    if np.diff(system.resolved.edges).min() > system.period / (2 * NODES):
        return spectrum
    return replace(spectrum, errors=spectrum.errors + ROOT_EPS * tol * np.maximum(system.period, np.abs(spectrum.logs)))


def compare_noise(system: PeriodicSystem, spectrum: SegmentedSpectrum) -> SegmentedSpectrum:
    """Enlarge the errors by what other segments change, where what two methods differ by is rounding.

    The rounding of a strongly non-normal factor is far above that of its entries, in both methods, which may agree by accident.
    """
    setting, panels = spectrum.setting, len(spectrum.setting.shares)
    finer = replace(setting, segments=int(np.ceil(FINER_BOUNDS[0] * setting.segments)) + panels)  # more in every panel
    other = find_exponents_with_errors(system, finer, factor_twice(system, finer), spectrum.start)[0]
    moved = match_logs(spectrum.logs, other.logs)[1]
    return replace(spectrum, errors=np.maximum(spectrum.errors, METHOD_SAFETY * moved))


def find_exponents_with_errors(
    system: PeriodicSystem, setting: Setting, factored: Factored, start: Array | None = None, part: bool = False
) -> tuple[SegmentedSpectrum, Array]:
    """The exponents at one resolution, and the method's part of their errors (n,)."""
    (plain, better), steps, unknown = factored
    damped = setting.method == "radau"  # what is fast is damped: the stages do not cancel
    found = find_spectrum(plain, better, unknown, start=start, steps=None if damped else steps, part=part)
    logs, rounding = found.logs, found.rounding
    method = enlarge_small_errors(found, system.period)
    errors = METHOD_SAFETY * method + rounding
    if damped:
        grid = place_segments(system, setting)
        below, hidden = logs.real[0] - logs.real, system.period * hidden_growth(system, grid) - logs.real[0]
        errors = np.where((errors > SLIGHT * below) & (below > max(EXTINCT_DECAY, errors[0])), np.inf, errors)
        method, errors = (np.append(np.maximum(part[0], hidden), part[1:]) for part in (method, errors))
    errors = errors + liouville_excess(system, logs, errors)
    # a multiplier of which no digit is known may be any that roundings lead to
    lost = (errors > 1) & np.isfinite(errors)
    errors = np.where(lost, errors + np.ptp(logs.real), errors)
    return SegmentedSpectrum(logs, errors, rounding, setting, found.start, found.stretched), method


def hidden_growth(system: PeriodicSystem, grid: Array) -> float:
    """How fast modes grow, in 1/s, that turn too fast for the segments: an L-stable method damps them whatever they do.

        growth = Re lambda - Re l' r',   |r| = 1,   l' r = 1

    The mean in time of the largest over those eigenvalues of A(t) whose size exceeds RADAU_TURN of a segment, with what every other look
    says less; -inf where there are none. The second term is what a mode gains by the change of its shape.
    """
    t = system.period * (np.arange(LOOK_SEGMENTS) + 0.5) / LOOK_SEGMENTS
    h = np.diff(grid)[np.searchsorted(grid, t, side="right") - 1]
    later = CUBE_ROOT_EPS * system.period
    values, right = np.linalg.eig(system.resolved(t))
    turning = np.abs(values) * h[:, None] > RADAU_TURN
    some = turning.any(axis=1)
    if not some.any():
        return -np.inf
    after, turned = np.linalg.eig(system.resolved(t[some] + later))
    partner = np.abs(values[some, :, None] - after[:, None]).argmin(axis=2)
    same = np.take_along_axis(turned, partner[:, None], axis=2)
    growth = np.full(len(t), -np.inf)
    with np.errstate(divide="ignore"):
        change = np.log(np.abs(np.einsum("tij,tji->ti", np.linalg.pinv(right[some]), same))) / later
    growth[some] = np.where(turning[some], values[some].real - change, -np.inf).max(axis=1)
    means = [float(part[np.isfinite(part)].mean()) for part in (growth[::2], growth[1::2]) if np.isfinite(part).any()]
    return max(means) + (max(means) - min(means))


def enlarge_small_errors(found: ProductSpectrum, period: float) -> Array:
    """The errors of the logs by the method (n,): every mode has at least a part of the worst mode's, each relative to max(T, |log|).

    A mode whose rounding exceeds its error by the method says nothing of the others: what moves it is rounding too.
    """
    size = np.maximum(period, np.abs(found.logs))
    known = (found.method < LOST_ERROR * size) & (found.method > found.rounding)
    worst = float((found.method / size)[known].max(initial=0.0))
    return np.maximum(found.method, SHARED_ERROR * worst * size)


def liouville_excess(system: PeriodicSystem, logs: Array, errors: Array) -> float:
    """What the sum of the logs misses of int_0^T tr A dt beyond the errors, shared out; 0 where a mode is unresolved.

    Liouville's identity, an independent look at all exponents at once.
    """
    if not np.isfinite(errors).all():
        return 0.0
    trace = np.diagonal(system.resolved.mean())
    known = FAINT * float(np.abs(trace).sum())
    missed = abs(float(logs.real.sum()) - system.period * float(trace.sum()))
    return max(0.0, missed - float(errors.sum()) - system.period * known) / len(logs)
