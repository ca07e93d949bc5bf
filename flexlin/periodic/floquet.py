"""Floquet exponents of a periodic system, with their own error and a verdict that admits doubt."""

import math
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array, positive
from flexlin.errors import ToleranceNotReached
from flexlin.periodic.collocation import gauss, nodes, samples
from flexlin.periodic.eigenvalues import PROBES, partners, product_spectrum
from flexlin.periodic.grid import edges
from flexlin.periodic.hamiltonian import is_hamiltonian, paired
from flexlin.periodic.hill import hill_spectrum
from flexlin.periodic.mass_rounding import mass_rounding
from flexlin.periodic.product import GROUP_CONDITION
from flexlin.periodic.setting import MAX_SEGMENTS, Setting, chosen, factors, radau_segments, rates, too_many
from flexlin.periodic.system import PeriodicSystem

QUADRATURE = 32
"""Gauss nodes in one panel of the trace integral: more accurate than the transition matrices on as many samples."""
LOST = 23.0
"""Log of the ratio of two modes in one segment beyond which the weaker one is lost (1e-10)."""
PILOT = 256
"""Segments of Gauss collocation beyond which the Magnus series is tried."""
SAFETY, TRUST = 6.0, 0.75
"""Factor on the estimated error, and the part of a method's order that the estimate relies on."""


@dataclass(frozen=True)
class FloquetResult:
    """Floquet exponents lambda of x' = A(t) x: solutions exp(lambda t) p(t), p(t + T) = p(t).

    exponents (n,) complex in 1/s by falling real part, imaginary parts in (-pi/T, pi/T]; log_multipliers = lambda T;
    errors (n,): estimated bounds of |error of each exponent|, inf for those that decay too fast to be resolved;
    error: the largest of the finite ones;
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
        """The largest error of a resolved exponent, in 1/s."""
        return float(self.errors[np.isfinite(self.errors)].max())

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
    basis: Array | None


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
    method: auto, gauss, magnus, radau or hill; order and segments: fix the resolution (no refinement then; order means harmonics for hill).
    Returns: FloquetResult.
    Raises: ArgumentError; TooManySegments with the figure when tol needs more than max_segments.
    """
    if method == "hill":
        return by_hill(system, positive("tol", tol), order)
    setting = chosen(system, positive("tol", tol), method, order, segments)
    levels: list[Level] = []
    if method == "auto" and setting.segments > PILOT:
        setting, levels = piloted(system, setting, tol, max_segments)
    if setting.segments > max_segments:
        raise too_many(setting.segments, max_segments, tol)
    levels = levels or three_levels(system, setting)
    previous = np.inf
    while segments is None:
        excess = missing_factor(system, setting, levels, tol)
        if excess <= 1 or (excess > 0.7 * previous and near_rounding(levels, setting)):
            break
        count = next_count(levels[-1].segments, excess, setting.order)
        if count > max_segments:
            raise too_many(count, max_segments, tol)
        levels.append(level(system, setting.with_segments(count), levels[-1].basis))
        previous = excess
    fine, setting = levels[-1], setting.with_segments(levels[-1].segments)
    errors = estimated_errors(levels[-3:], setting)
    errors += mass_rounding(system, setting, fine.logs)
    if np.isfinite(errors).all():
        errors *= max(1.0, liouville_defect(system, setting, fine.logs) / errors.sum())
    logs, undamped = fine.logs, abs(fine.logs.real.sum()) <= errors.sum() and is_hamiltonian(system)
    if undamped:
        logs, violation = paired(logs)
        errors = np.maximum(errors, violation)
    return judged(logs / system.period, errors / system.period, system.period, setting, tol, undamped)


def by_hill(system: PeriodicSystem, tol: float, harmonics: int | None) -> FloquetResult:
    """The same exponents by the independent Fourier route, imaginary parts folded into (-pi/T, pi/T]."""
    spectrum = hill_spectrum(system, tol, harmonics)
    w = 2 * np.pi / system.period
    folded = spectrum.exponents - 1j * w * np.ceil(spectrum.exponents.imag / w - 0.5)
    setting = Setting("hill", spectrum.harmonics, 1, "as asked")
    return judged(folded, spectrum.errors, system.period, setting, tol)


def three_levels(system: PeriodicSystem, setting: Setting) -> list[Level]:
    """The spectrum on a half, three quarters and all of the segments; the rounding is measured on the last."""
    levels: list[Level] = []
    for part in (0.5, 0.75, 1.0):
        basis = levels[-1].basis if levels else None
        count = max(1, round(part * setting.segments))
        levels.append(level(system, setting.with_segments(count), basis, probes=part == 1))
    return levels


def missing_factor(system: PeriodicSystem, setting: Setting, levels: list[Level], tol: float) -> float:
    """By how much the worst resolved exponent misses tol (1 or less: reached, or rounding allows no more)."""
    errors = estimated_errors(levels[-3:], setting)
    allowed = np.maximum(tol * np.maximum(system.period, np.abs(levels[-1].logs)), 2 * SAFETY * levels[-1].rounding)
    return float((errors / allowed)[np.isfinite(errors)].max())


def near_rounding(levels: list[Level], setting: Setting) -> bool:
    """Whether the errors are within a thousand times the measured rounding: where refinement stalls there, it has ended."""
    errors = estimated_errors(levels[-3:], setting)
    return bool(np.all((errors <= 1e3 * levels[-1].rounding) | np.isinf(errors)))


def piloted(system: PeriodicSystem, gauss_plan: Setting, tol: float, max_segments: int) -> tuple[Setting, list[Level]]:
    """Try the Magnus series, which is exact on the constant part, where Gauss collocation would need many segments.

    Returns the plan of least work, with its levels where the trial itself has reached tol.
    """
    _, spread, top = rates(system)
    least = math.ceil(system.period * spread / math.log(GROUP_CONDITION))
    if least > max_segments:
        count = 4 * radau_segments(system.period, top)
        return Setting("radau", 9, count, "modes that decay too fast to be resolved are only bounded"), []
    best, reached = gauss_plan, []
    for order in (4, 6):
        pilot = Setting("magnus", order, max(PILOT, least), "the Magnus series carries fast modes exactly")
        if pilot.segments <= max_segments and pilot.work(system.n) < best.work(system.n):
            try:
                levels = three_levels(system, pilot)
            except ToleranceNotReached:
                continue
            excess = max(1.0, missing_factor(system, pilot, levels, tol))
            plan = pilot.with_segments(math.ceil(pilot.segments * excess ** (1 / order)))
            if plan.work(system.n) < best.work(system.n):
                best, reached = plan, levels if excess == 1 else []
    return best, reached


def level(system: PeriodicSystem, setting: Setting, basis: Array | None = None, probes: bool = True) -> Level:
    """The spectrum at one resolution, from the basis of another; the rounding is measured only where it is asked."""
    turns = rates(system)[0] * system.period if setting.method == "magnus" else 0.0
    spectrum = product_spectrum(factors(system, setting)[1], PROBES if probes else 0, turns, basis)
    return Level(setting.segments, spectrum.logs, spectrum.rounding, spectrum.basis)


def next_count(segments: int, worst: float, order: int) -> int:
    """The number of segments that the order promises to suffice: at least a half more, at most four times as many."""
    return int(np.ceil(segments * min(4.0, max(1.5, 1.2 * worst ** (1 / order)))))


def estimated_errors(levels: list[Level], setting: Setting) -> Array:
    """Errors of the logs at the finest of three resolutions, from their differences and from rounding.

        d_12 ~ C k_1^-p,   d_23 ~ C k_2^-p   give p,   error_3 ~ d_23 (k_2 / k_3)^p

    p is taken for all exponents together and for each alone, whichever is less, and never near the method's full order:
    a forgotten break or a rough coefficient shows as a small p, and then the larger difference counts. The error is infinite for
    an exponent that is only known to lie below the others: LOST in rounding behind the largest one in every segment, or, with
    an L-stable method, still sinking far below the largest one as segments get shorter.
    """
    coarse, middle, fine = levels
    partner, d_23 = partners(fine.logs, middle.logs)
    d_12 = partners(middle.logs, coarse.logs)[1][partner]
    tiny = np.finfo(float).tiny
    together = np.log(max(d_12.max(), tiny) / max(d_23.max(), tiny))
    alone = np.log(np.maximum(d_12, tiny) / np.maximum(d_23, tiny))
    p = np.minimum(together, alone) / np.log(max(middle.segments / coarse.segments, 1.01))
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


def liouville_defect(system: PeriodicSystem, setting: Setting, logs: Array) -> float:
    """How far the exponents miss Liouville's identity, sum_i log mu_i = int_0^T tr A dt (real parts), by Gauss quadrature.

    The sum of the errors cannot be less than this; the quadrature's own error is forgiven.
    """
    grid = edges(system.period, system.breaks, -(-setting.segments * setting.order // (2 * QUADRATURE)))
    integral, check = (trace_integral(system, grid, stages) for stages in (QUADRATURE, QUADRATURE * 2 // 3))
    return max(0.0, abs(float(logs.real.sum()) - integral) - abs(integral - check))


def trace_integral(system: PeriodicSystem, grid: Array, stages: int) -> float:
    """int_0^T tr A dt by Gauss quadrature on the panels of the grid."""
    rule = gauss(stages)
    trace = np.trace(samples(system.A, nodes(grid, rule.c)), axis1=-2, axis2=-1)
    return float(np.diff(grid) @ (trace @ rule.b))


def judged(
    exponents: Array, errors: Array, period: float, setting: Setting, tol: float, undamped: bool = False
) -> FloquetResult:
    """Give the verdict: undecided when an exponent's distance to the imaginary axis is below its error."""
    growth = exponents.real
    critical = int(np.argmax(growth + np.where(np.isinf(errors), -np.inf, errors)))
    if np.any(growth > errors):
        critical = int(np.argmax(growth - errors))
        verdict = "unstable"
    elif np.all((growth < -errors) | (np.isinf(errors) & (growth < 0))):
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
    if undamped and verdict == "undecided" and isolated(exponents, errors, period):
        advice = (
            "the system is undamped and every multiplier is simple: all lie on the unit circle, the motion stays bounded "
            "and nothing decays; add damping for a margin"
        )
    hidden = int(np.isinf(errors).sum())
    if hidden:
        advice += f"; {hidden} exponents decay too fast to be resolved and are only known to lie below the others"
    missed = bool(np.any((errors > tol * np.maximum(1, np.abs(exponents))) & np.isfinite(errors)))
    limit = (
        f"; tol {tol:.0e} was not reached, the error above is what rounding and the resolution allow" if missed else ""
    )
    return FloquetResult(exponents, errors, period, verdict, f"{verdict}: {facts}; {advice}{limit}", setting)


def isolated(exponents: Array, errors: Array, period: float) -> bool:
    """Whether no two exponents are within their errors: then the pairing (lambda, -conj lambda) holds each on the axis."""
    apart = exponents[:, None] - exponents
    w = 2 * np.pi / period
    size = np.hypot(apart.real, np.remainder(apart.imag + w / 2, w) - w / 2)
    np.fill_diagonal(size, np.inf)
    return bool(np.all(size > errors[:, None] + errors))
