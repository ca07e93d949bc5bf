"""Which method, order and number of segments reach a tolerance at the least work."""

import math
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.product.balancing import GROUP_CONDITION
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.factors import MOST_UNKNOWNS
from flexlin.periodic.transition.setting import METHODS, ORDERS, Setting

MARGIN = 40.0
"""The first guess aims at this part of tol: a sixth more segments cost less than a second try."""
STAGES = range(4, 11)
"""Gauss stages among which the engine chooses."""
LEAST = 4
"""Segments of a period at the least: on fewer, a method and a better one err alike."""
WAVES = 3.0
"""Gauss nodes for each harmonic of the coefficients, so that none hides between them."""
COMPILED = 0.4
"""The part of the time of NumPy's solves that compiled code takes."""
PLACES = 96
"""Times at which the eigenvalues of A(t) are looked at."""


@dataclass(frozen=True)
class Pace:
    """How fast a system moves on each panel of its resolved coefficients, (P,).

    length in s; rate: largest |eigenvalue| of A(t), at least the basic frequency (1/s); spread: of the real parts (1/s);
    waves: polynomial degree or harmonics of the coefficients that matter at the wanted accuracy; top: the largest real part.
    """

    length: Array
    rate: Array
    spread: Array
    waves: Array
    top: float


def measure_pace(system: PeriodicSystem, accuracy: float = 1e-9) -> Pace:
    """Look at the eigenvalues of A(t) on every panel, and at the coefficients' series."""
    resolved = system.resolved
    length = np.diff(resolved.edges)
    each = max(1, min(16, PLACES // len(length)))
    t = (resolved.edges[:-1, None] + length[:, None] * (np.arange(each) + 0.37) / each).ravel()
    values = np.linalg.eigvals(resolved(t)).reshape(len(length), -1)
    rate = np.maximum(np.abs(values).max(axis=1), 2 * np.pi / system.period)
    waves = count_waves(system, accuracy)
    return Pace(length, rate, np.ptp(values.real, axis=1), waves, float(values.real.max()))


def count_waves(system: PeriodicSystem, accuracy: float) -> Array:
    """The highest harmonic, or for each panel the degree, whose coefficient exceeds the accuracy relative to the entry, (P,)."""
    series = system.resolved.series
    size = np.abs(series.coefficients)
    if isinstance(series, FourierSeries):
        H = series.harmonics
        waves = np.hypot(size[1 : H + 1], size[H + 1 :]) > accuracy * size.max(axis=0)
        return np.array([1 + np.flatnonzero(waves.any(axis=(1, 2))).max(initial=0)])
    seen = (size > accuracy * size.max(axis=(0, 1))).any(axis=(2, 3))
    return seen.shape[1] - np.argmax(seen[:, ::-1], axis=1)


def choose_setting(system: PeriodicSystem, tol: float, method: str, order: int | None, segments: int | None) -> Setting:
    """Fill in what the user left open; the refinement that follows corrects the guess.

    A Gauss step of s stages has the error of the diagonal Pade approximation on the fastest eigenvalue `rate` of A(t),

        error of the exponents ~ rate c (h rate)^(2 s),   c = (s!)^2 / ((2 s)! (2 s + 1)!)

    so h follows from tol and s, and the s of least work is taken. No segment may separate two modes by more than
    GROUP_CONDITION: beyond that its transition matrix cannot hold the weaker one.
    """
    if method not in ("auto", *METHODS):
        raise ArgumentError("unknown method", got=repr(method), expected=", ".join(["auto", "hill", *METHODS]))
    name = "gauss" if method == "auto" else method
    if order is not None and order not in ORDERS[name]:
        raise ArgumentError(f"{name} has no such order", got=order, expected=", ".join(map(str, ORDERS[name])))
    pace = measure_pace(system, 0.01 * tol)
    rate = float(pace.rate.max())
    if method == "radau":
        return spread_out("radau", order or 9, radau_demand(pace), "as asked", rate, segments)
    eigenvalues = f"eigenvalues of A(t) up to {rate:.3g} 1/s"
    reason = f"least work for tol {tol:.0e} with {eigenvalues}" if segments is None else f"as asked, with {eigenvalues}"
    plans = [
        spread_out("gauss", 2 * s, gauss_demand(pace, tol, s), reason, rate, segments)
        for s in (STAGES if order is None else [order // 2])
    ]
    second_order = system.second_order is not None
    unknowns = system.n // 2 if second_order else system.n
    return min(plans, key=lambda plan: estimate_gauss_work(plan.order // 2, unknowns, plan.segments, second_order))


def spread_out(method: str, order: int, demand: Array, reason: str, rate: float, segments: int | None) -> Setting:
    """A setting whose segments are shared among the panels by their demand (P,)."""
    shares = tuple((demand / demand.sum()).tolist()) if len(demand) > 1 else ()
    return Setting(method, order, segments or int(np.ceil(demand).sum()), reason, rate, shares)


def gauss_demand(pace: Pace, tol: float, stages: int) -> Array:
    """Segments that each panel needs with s Gauss stages, (P,)."""
    steps = pace.length / choose_gauss_step(pace.rate, tol, stages)
    return np.maximum.reduce(
        [steps, separate_modes(pace), WAVES * pace.waves / stages, np.full(len(steps), max(1.0, LEAST / len(steps)))]
    )


def radau_demand(pace: Pace) -> Array:
    """Segments short enough that an L-stable method does not damp what grows: h times the fastest growth stays below 1/2, (P,)."""
    return np.maximum.reduce(
        [2 * pace.length * pace.top, WAVES * pace.waves / 5, np.full(len(pace.rate), 32.0 / len(pace.rate))]
    )


def separate_modes(pace: Pace) -> Array:
    """Segments in none of which two modes part by more than GROUP_CONDITION, (P,)."""
    return pace.length * pace.spread / math.log(GROUP_CONDITION)


def choose_gauss_step(rate: Array, tol: float, stages: int) -> Array:
    """The step at which s Gauss stages reach tol / MARGIN on the eigenvalue `rate`."""
    c = gauss_constant(stages)
    return (tol / MARGIN * np.maximum(1.0, rate) / (rate * c)) ** (0.5 / stages) / rate


def gauss_constant(stages: int) -> float:
    """The constant c in the error of s Gauss stages."""
    return math.factorial(stages) ** 2 / (math.factorial(2 * stages) * math.factorial(2 * stages + 1))


def estimate_gauss_work(stages: int, unknowns: int, segments: int, second_order: bool) -> float:
    """Microseconds of the batched solves with s stages of n unknowns each, as measured: overhead, memory and flops of one segment."""
    size = stages * unknowns
    compiled = second_order and size <= MOST_UNKNOWNS
    return 300 + segments * (4 + 0.012 * size**2 + 1.5e-4 * size**3) * (COMPILED if compiled else 1.0)


def estimate_segment_work(n: int, second_order: bool, setting: Setting) -> float:
    """Microseconds of a Gauss setting with its check by two stages more and the sweeps over its factors, as measured, for n states."""
    unknowns = n // 2 if second_order else n
    both = sum(
        estimate_gauss_work(setting.order // 2 + extra, unknowns, setting.segments, second_order) for extra in (0, 2)
    )
    return both + 3 * min(setting.segments, 50 + setting.segments / 4) * (6 + 0.05 * n**2)


def estimate_evidence_work(n: int, segments: int) -> float:
    """Microseconds to carry all n Floquet vectors through the segments for the errors, as measured at n = 8 to 18."""
    return 0.15 * segments * n**3


def fall_back(system: PeriodicSystem, tol: float) -> Setting:
    """A setting for modes that are too fast for Gauss collocation: Radau, which only bounds those that decay too fast."""
    pace = measure_pace(system, 0.01 * tol)
    reason = "other methods would take too many segments; modes that decay too fast for these are only bounded"
    return spread_out("radau", 9, 4 * radau_demand(pace), reason, float(pace.rate.max()), None)
