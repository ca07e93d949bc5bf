"""How a period is integrated: method, order and number of segments, and the reason for the choice."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError, TooManySegments
from flexlin.periodic.collocation import gauss_transitions, second_order_transitions
from flexlin.periodic.grid import edges
from flexlin.periodic.system import PeriodicSystem

MAX_SEGMENTS = 20_000


@dataclass(frozen=True)
class Setting:
    """A method of transition matrices with its order, the number of segments, and why it was taken."""

    method: str
    order: int
    segments: int
    reason: str

    def __str__(self) -> str:
        return f"{self.method} of order {self.order} on {self.segments} segments ({self.reason})"

    def with_segments(self, segments: int) -> "Setting":
        return replace(self, segments=segments)


def gauss_factors(system: PeriodicSystem, grid: Array, order: int) -> Array:
    """Gauss collocation of even order, in the accelerations where the system is of second order."""
    if system.second_order is not None:
        return second_order_transitions(system.second_order, grid, order // 2)
    return gauss_transitions(system.A, grid, order // 2)


METHODS: dict[str, Callable[[PeriodicSystem, Array, int], Array]] = {"gauss": gauss_factors}
"""Each: (system, edges, order) -> transition matrices (K, n, n)."""


def factors(system: PeriodicSystem, setting: Setting) -> tuple[Array, Array]:
    """Return the edges (K + 1,) and the transition matrices (K, n, n) of one period."""
    grid = edges(system.period, system.breaks, setting.segments)
    return grid, METHODS[setting.method](system, grid, setting.order)


def chosen(system: PeriodicSystem, tol: float, method: str, order: int | None, segments: int | None) -> Setting:
    """Fill in what the user left open.

    A Gauss step of s stages has the error of the diagonal Pade approximation on the fastest eigenvalue `rate` of A(t),

        error of the exponents ~ rate c (h rate)^(2 s),   c = (s!)^2 / ((2 s)! (2 s + 1)!)

    so h follows from tol and s, and the s of least work is taken. The refinement that follows corrects the guess.
    """
    if method not in ("auto", *METHODS):
        raise ArgumentError("unknown method", got=repr(method), expected=", ".join(["auto", "hill", *METHODS]))
    if order is not None and (order < 2 or order % 2):
        raise ArgumentError("order is not an even number", got=order, expected="2, 4, 6 ...")
    name = "gauss" if method == "auto" else method
    if order is not None and segments is not None:
        return Setting(name, order, segments, "as given")
    rate = fastest_rate(system)
    n = system.n
    stages = range(2, 13) if order is None else [order // 2]
    plans = {s: math.ceil(system.period / gauss_step(rate, tol, s)) for s in stages}
    best = min(plans, key=lambda s: plans[s] * (2 * s + 3 + 0.0005 * (s * n) ** 3))
    reason = f"least work for tol {tol:.0e} with eigenvalues of A(t) up to {rate:.3g} 1/s"
    return Setting(name, 2 * best, segments or max(4, plans[best]), reason)


def gauss_step(rate: float, tol: float, stages: int) -> float:
    """The step at which s Gauss stages reach tol on the eigenvalue `rate`."""
    c = math.factorial(stages) ** 2 / (math.factorial(2 * stages) * math.factorial(2 * stages + 1))
    return (tol * max(1.0, rate) / (rate * c)) ** (0.5 / stages) / rate


def fastest_rate(system: PeriodicSystem) -> float:
    """The largest modulus of an eigenvalue of A(t) on a few samples of the period, at least the basic frequency."""
    t = system.period * (np.arange(16) + 0.37) / 16
    return max(float(np.abs(np.linalg.eigvals(system.A(t))).max()), 2 * np.pi / system.period)


def too_many(wanted: float, limit: int, tol: float) -> TooManySegments:
    return TooManySegments(
        f"tol {tol:.1e} needs about {wanted:.2g} segments of the period",
        got=f"{wanted:.2g}",
        expected=f"at most {limit}",
        todo="loosen tol, leave out the fastest modes, or raise max_segments and wait",
    )
