"""The spectrum at several resolutions: what they say about its error, and how fine the last must be."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import match_logs
from flexlin.periodic.product.eigenvalues import PROBES, product_spectrum
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.setting import Setting, factor_period, report_too_many

LOST = 23.0
"""Log of the ratio of two modes in one segment beyond which the weaker one is lost (1e-10)."""
SAFETY, TRUST = 6.0, 0.65
"""Factor on the estimated error, and the part of a method's order that the estimate relies on."""


@dataclass(frozen=True)
class Level:
    """The spectrum at one resolution: logs of the multipliers and the motion that rounding gives them."""

    segments: int
    logs: Array
    rounding: Array
    basis: Array | None


def compute_levels(system: PeriodicSystem, setting: Setting) -> list[Level]:
    """The spectrum on a half, three quarters and all of the segments; the rounding is measured on the last."""
    levels: list[Level] = []
    for part in (0.5, 0.75, 1.0):
        basis = levels[-1].basis if levels else None
        count = max(1, round(part * setting.segments))
        levels.append(compute_level(system, setting.with_segments(count), basis, probes=part == 1))
    return levels


def refine_spectrum(
    system: PeriodicSystem, setting: Setting, levels: list[Level], tol: float, max_segments: int
) -> list[Level]:
    """Add finer levels until tol is reached, or rounding allows no more.

    Raises: TooManySegments.
    """
    levels, previous = list(levels), np.inf
    while True:
        excess = measure_excess(setting, levels, tol, system.period)
        if excess <= 1 or (excess > 0.7 * previous and is_near_rounding(levels, setting)):
            return levels
        count = predict_count(levels[-1].segments, excess, setting.order)
        if count > max_segments:
            raise report_too_many(count, max_segments, tol)
        levels.append(compute_level(system, setting.with_segments(count), levels[-1].basis))
        previous = excess


def compute_level(system: PeriodicSystem, setting: Setting, basis: Array | None = None, probes: bool = True) -> Level:
    """The spectrum at one resolution, from the basis of another; the rounding is measured only where it is asked."""
    turns = setting.rate * system.period
    spectrum = product_spectrum(factor_period(system, setting)[1], PROBES if probes else 0, turns, basis)
    return Level(setting.segments, spectrum.logs, spectrum.rounding, spectrum.basis)


def measure_excess(setting: Setting, levels: list[Level], tol: float, period: float) -> float:
    """By how much the worst resolved exponent misses tol (1 or less: reached, or rounding allows no more)."""
    errors = estimate_errors(levels[-3:], setting)
    allowed = np.maximum(tol * np.maximum(period, np.abs(levels[-1].logs)), 2 * SAFETY * levels[-1].rounding)
    return float((errors / allowed)[np.isfinite(errors)].max())


def is_near_rounding(levels: list[Level], setting: Setting) -> bool:
    """Whether the errors are within a thousand times the measured rounding: where refinement stalls there, it has ended."""
    errors = estimate_errors(levels[-3:], setting)
    return bool(np.all((errors <= 1e3 * levels[-1].rounding) | np.isinf(errors)))


def predict_count(segments: int, worst: float, order: int) -> int:
    """The number of segments that the order promises to suffice: at least a half more, at most four times as many."""
    return int(np.ceil(segments * min(4.0, max(1.5, 1.2 * worst ** (1 / order)))))


def estimate_errors(levels: list[Level], setting: Setting) -> Array:
    """Errors of the logs at the finest of three resolutions, from their differences and from rounding.

        d_12 ~ C k_1^-p,   d_23 ~ C k_2^-p   give p,   error_3 ~ d_23 (k_2 / k_3)^p

    A difference that is small by accident counts as what the coarser one promises at full order.
    p is taken for all exponents together and for each alone, whichever is less, and never near the method's full order:
    a forgotten break or a rough coefficient shows as a small p, and then the larger difference counts. The error is infinite for
    an exponent that is only known to lie below the others: LOST in rounding behind the largest one in every segment, or, with
    an L-stable method, still sinking far below the largest one as segments get shorter.
    """
    coarse, middle, fine = levels
    partner, d_23 = match_logs(fine.logs, middle.logs)
    d_12 = match_logs(middle.logs, coarse.logs)[1][partner]
    tiny = np.finfo(float).tiny
    together = np.log(max(d_12.max(), tiny) / max(d_23.max(), tiny))
    alone = np.log(np.maximum(d_12, tiny) / np.maximum(d_23, tiny))
    p = np.minimum(together, alone) / np.log(max(middle.segments / coarse.segments, 1.01))
    d_23 = np.maximum(d_23, d_12 * (coarse.segments / middle.segments) ** setting.order)
    reduction = (middle.segments / fine.segments) ** np.clip(p, 0.0, TRUST * setting.order)
    smooth = p > setting.order / 2
    errors = SAFETY * np.where(smooth, reduction * d_23, np.maximum(d_12, d_23)) + fine.rounding
    below = fine.logs.real.max() - fine.logs.real
    sinking = (
        (below > 0)
        & (errors > below / 2)
        & (fine.logs.real < 1.1 * middle.logs.real[partner])
        & (setting.method == "radau")
    )
    return np.where((below > LOST * fine.segments) | sinking, np.inf, errors)
