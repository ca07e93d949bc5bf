"""Floquet exponents of a periodic system, with their own error and a verdict that admits doubt."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array, positive
from flexlin.periodic.eigenvalues import distances, product_spectrum
from flexlin.periodic.setting import MAX_SEGMENTS, Setting, chosen, factors, too_many
from flexlin.periodic.system import PeriodicSystem


@dataclass(frozen=True)
class FloquetResult:
    """Floquet exponents lambda of x' = A(t) x: solutions exp(lambda t) p(t), p(t + T) = p(t).

    exponents (n,) complex in 1/s by falling real part, imaginary parts in (-pi/T, pi/T]; log_multipliers = lambda T;
    errors (n,): estimated bounds of |error of each exponent|; error: that of the verdict, the largest of them;
    verdict: stable, unstable or undecided; status: what it rests on and what to do next; setting: method, order, segments, reason.
    """

    exponents: Array
    errors: Array
    period: float
    verdict: str
    status: str
    setting: Setting

    @property
    def error(self) -> float:
        """The largest of the errors of the exponents, in 1/s."""
        return float(self.errors.max())

    @property
    def log_multipliers(self) -> Array:
        """log of the multipliers; imaginary parts in (-pi, pi]."""
        return self.exponents * self.period

    @property
    def multipliers(self) -> Array:
        """exp(lambda T); 0 or inf where that leaves the range of floating-point numbers."""
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            size = np.exp(self.log_multipliers.real)
            angle = self.log_multipliers.imag
            return np.where(np.isinf(size), size + 0j, size * np.exp(1j * angle))


@dataclass(frozen=True)
class Level:
    """The spectrum at one resolution: logs of the multipliers and the motion that rounding gives them."""

    segments: int
    logs: Array
    rounding: Array


def floquet(
    system: PeriodicSystem,
    tol: float = 1e-9,
    *,
    method: str = "auto",
    order: int | None = None,
    segments: int | None = None,
    max_segments: int = MAX_SEGMENTS,
) -> FloquetResult:
    """Compute the Floquet exponents of x' = A(t) x.

        Phi(T) = F_K ... F_1,   mu_i = eigenvalues of Phi(T),   lambda_i = log(mu_i) / T

    Assumes A smooth between the system's breaks. The product is never formed, so exponents far apart keep their digits.

    Parameters: tol: wanted error of an exponent, in 1/s up to |lambda| = 1/s and relative beyond;
    method: auto, gauss, magnus or hill; order and segments: fix the resolution (no refinement then).
    Returns: FloquetResult.
    Raises: ArgumentError; TooManySegments with the figure when tol needs more than max_segments.
    """
    setting = chosen(system, positive("tol", tol), method, order, segments)
    if setting.segments > max_segments:
        raise too_many(setting.segments, max_segments, tol)
    count = setting.segments
    levels = [level(system, setting.with_segments(max(1, k))) for k in (count // 4, count // 2, count)]
    while segments is None:
        errors = estimated_errors(levels[-3:], setting.order) / system.period
        worst = float((errors / (tol * np.maximum(1, np.abs(levels[-1].logs) / system.period))).max())
        limited = np.all(errors * system.period <= np.maximum(4 * levels[-1].rounding, 1e-300))
        if worst <= 1 or limited:
            break
        count = next_count(levels[-1].segments, worst, setting.order)
        if count > max_segments:
            raise too_many(count, max_segments, tol)
        levels.append(level(system, setting.with_segments(count)))
    fine = levels[-1]
    errors = estimated_errors(levels[-3:], setting.order) / system.period
    return judged(fine.logs / system.period, errors, system.period, setting.with_segments(fine.segments), tol)


def level(system: PeriodicSystem, setting: Setting) -> Level:
    """The spectrum at one resolution."""
    spectrum = product_spectrum(factors(system, setting)[1])
    return Level(setting.segments, spectrum.logs, spectrum.rounding)


def next_count(segments: int, worst: float, order: int) -> int:
    """The number of segments that the order promises to suffice: at least a half more, at most four times as many."""
    return int(np.ceil(segments * min(4.0, max(1.5, 1.2 * worst ** (1 / order)))))


def estimated_errors(levels: list[Level], order: int) -> Array:
    """Errors of the logs at the finest of three resolutions, from their differences and from rounding.

        d_12 ~ C k_1^-p,   d_23 ~ C k_2^-p   give p (never above the method's order),   error_3 ~ d_23 (k_2 / k_3)^p

    A missing break or a rough coefficient shows as a small p, so the estimate stays honest there.
    """
    coarse, middle, fine = levels
    d_12, d_23 = distances(middle.logs, coarse.logs).max(), distances(fine.logs, middle.logs)
    tiny = np.finfo(float).tiny
    ratio = np.log(max(middle.segments / coarse.segments, 1.01))
    observed = np.log(max(d_12, tiny) / max(d_23.max(), tiny)) / ratio
    p = min(max(observed, 0.0), float(order))
    return SAFETY * d_23 * (middle.segments / fine.segments) ** p + fine.rounding


SAFETY = 4.0


def judged(exponents: Array, errors: Array, period: float, setting: Setting, tol: float) -> FloquetResult:
    """Give the verdict: undecided when an exponent's distance to the imaginary axis is below its error."""
    growth = exponents.real
    critical = int(np.argmax(growth + errors))
    if np.any(growth > errors):
        critical = int(np.argmax(growth - errors))
        verdict = "unstable"
    elif np.all(growth < -errors):
        verdict = "stable"
    else:
        verdict = "undecided"
    facts = f"growth rate {growth[critical]:.6g} +- {errors[critical]:.1e} 1/s by {setting}"
    advice = {
        "stable": "every disturbance decays",
        "unstable": "some disturbance grows: change the motion, the speed, the payload or the controller",
        "undecided": "the growth rate is zero to within its error: ask for a smaller tol, add damping, "
        "or treat the system as marginal (undamped and rigid-body modes are)",
    }[verdict]
    missed = bool(np.any(errors > tol * np.maximum(1, np.abs(exponents))))
    limit = (
        f"; tol {tol:.0e} was not reached, the error above is what rounding and the resolution allow" if missed else ""
    )
    return FloquetResult(exponents, errors, period, verdict, f"{verdict}: {facts}; {advice}{limit}", setting)
