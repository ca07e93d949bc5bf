"""How a period is integrated: method, order and number of segments, and the reason for the choice."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError, TooManySegments
from flexlin.periodic.grid import place_edges
from flexlin.periodic.product.balancing import GROUP_CONDITION
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.gauss import gauss_transitions, sample_at, second_order_transitions
from flexlin.periodic.transition.magnus import magnus_transitions
from flexlin.periodic.transition.radau import radau_transitions

MAX_SEGMENTS = 20_000
MIN_SEGMENTS = 8
MARGIN = 1000.0
"""The first guess aims this much below tol, so that the cautious error estimate is content with it."""
STAGES = range(3, 11)
"""Gauss stages among which the engine chooses."""


@dataclass(frozen=True)
class Setting:
    """A method of transition matrices with its order, the number of segments, why it was taken, and the fastest rate of A (1/s)."""

    method: str
    order: int
    segments: int
    reason: str
    rate: float = 0.0

    def __str__(self) -> str:
        if self.method == "hill":
            return f"Hill's matrix with {self.order} harmonics ({self.reason})"
        return f"{self.method} of order {self.order} on {self.segments} segments ({self.reason})"

    def with_segments(self, segments: int) -> "Setting":
        return replace(self, segments=segments)

    def work(self, n: int) -> float:
        """Rough work for n states in units of one sample of A, one call's overhead counted as 100 samples."""
        if self.method == "magnus":
            return 100 + self.segments * (self.order / 2 + 4 + 0.02 * n**3)
        stages = self.order // 2
        return 100 + self.segments * (stages + 2 + 0.001 * (stages * n) ** 2 + 0.0002 * (stages * n) ** 3)


def factor_by_gauss(system: PeriodicSystem, grid: Array, order: int) -> Array:
    """Gauss collocation of even order, in the accelerations where the system is of second order."""
    if system.second_order is not None:
        return second_order_transitions(system.second_order, grid, order // 2)
    return gauss_transitions(system.A, grid, order // 2)


def factor_by_magnus(system: PeriodicSystem, grid: Array, order: int) -> Array:
    """The Magnus series of order 4 or 6."""
    return magnus_transitions(system.A, grid, order)


def factor_by_radau(system: PeriodicSystem, grid: Array, order: int) -> Array:
    """Radau IIA collocation of odd order."""
    return radau_transitions(system.A, grid, (order + 1) // 2)


METHODS: dict[str, Callable[[PeriodicSystem, Array, int], Array]] = {
    "gauss": factor_by_gauss,
    "magnus": factor_by_magnus,
    "radau": factor_by_radau,
}
ORDERS = {"gauss": range(2, 65, 2), "magnus": (4, 6), "radau": range(1, 32, 2)}
"""Each: (system, edges, order) -> transition matrices (K, n, n)."""


def factor_period(system: PeriodicSystem, setting: Setting) -> tuple[Array, Array]:
    """Return the edges (K + 1,) and the transition matrices (K, n, n) of one period."""
    grid = place_edges(system.period, system.breaks, setting.segments)
    return grid, METHODS[setting.method](system, grid, setting.order)


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
    if order is not None and segments is not None:
        return Setting(name, order, segments, "as given", measure_rates(system)[0] if name == "magnus" else 0.0)
    rate, spread, top = measure_rates(system)
    least = max(MIN_SEGMENTS, math.ceil(system.period * spread / math.log(GROUP_CONDITION)))
    if method == "magnus":
        count = segments or max(2 * least, math.ceil(rate * system.period / 30))
        return Setting("magnus", order or 6, count, "as asked", rate)
    if method == "radau":
        return Setting("radau", order or 9, segments or count_radau_segments(system.period, top), "as asked")
    reason = f"least work for tol {tol:.0e} with eigenvalues of A(t) up to {rate:.3g} 1/s"
    plans = [
        Setting(
            "gauss", 2 * s, segments or max(least, math.ceil(system.period / choose_gauss_step(rate, tol, s))), reason
        )
        for s in (STAGES if order is None else [order // 2])
    ]
    return min(plans, key=lambda plan: plan.work(system.n))


def count_radau_segments(period: float, top: float) -> int:
    """Segments short enough that an L-stable method does not damp what grows: h times the fastest growth stays below 1/2."""
    return max(4 * MIN_SEGMENTS, math.ceil(2 * period * top))


def choose_gauss_step(rate: float, tol: float, stages: int) -> float:
    """The step at which s Gauss stages reach tol / MARGIN on the eigenvalue `rate`."""
    c = math.factorial(stages) ** 2 / (math.factorial(2 * stages) * math.factorial(2 * stages + 1))
    return (tol / MARGIN * max(1.0, rate) / (rate * c)) ** (0.5 / stages) / rate


def measure_rates(system: PeriodicSystem) -> tuple[float, float, float]:
    """Over a few A(t): the largest |eigenvalue| (at least the basic frequency), the spread of real parts, the largest real part."""
    values = np.linalg.eigvals(sample_at(system.A, system.period * (np.arange(16) + 0.37) / 16))
    return (
        max(float(np.abs(values).max()), 2 * np.pi / system.period),
        float(np.ptp(values.real)),
        float(values.real.max()),
    )


def report_too_many(wanted: float, limit: int, tol: float) -> TooManySegments:
    """The error that names how many segments tol needs."""
    return TooManySegments(
        f"tol {tol:.1e} needs about {wanted:.2g} segments of the period",
        got=f"{wanted:.2g}",
        expected=f"at most {limit}",
        todo="loosen tol, leave out the fastest modes, or raise max_segments and wait",
    )
