"""How a period is integrated: method, order and number of segments, and which of them reach a tolerance at the least work."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.special import gamma

from flexlin._core import LANES
from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError, TooManySegments, counted
from flexlin.periodic.coefficient_series.matrix import Series
from flexlin.periodic.interpolation import NODES, FourierSeries, divide_evenly
from flexlin.periodic.product import GROUP_CONDITION, Unknown
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.factors import factor_segments, measure_segments
from flexlin.periodic.transition.gauss import Tableau, gauss, radau

MAX_SEGMENTS, FEWER_SEGMENTS = 20_000, 4000
"""Of a period at the most, and where another way is open beyond."""
METHODS: dict[str, Callable[[int], Tableau]] = {"gauss": gauss, "radau": radau}
"""Each: stages -> tableau, of order 2 s and 2 s - 1."""
MOST_STAGES = NODES
"""More than a panel's polynomials have nodes see nothing new."""
GUESS_MARGIN = 400.0
"""The first guess aims at this part of tol: a third more segments cost less than a second try."""
STAGE_CHOICES = np.arange(4, 11)
"""Gauss stages among which the engine chooses."""
LEAST_SEGMENTS = 4
"""Segments of a period at the least: on fewer, a method and a better one err alike."""
NODES_PER_HARMONIC = 3.0
"""Gauss nodes for each harmonic of the coefficients, so that none hides between them."""
VECTOR_WORK, OTHER_WORK = 40, 10_000
"""Multiplications, times n^3, that carrying left and right vectors through a segment takes, and those that all else counts as."""
EIGENVALUE_TIMES = 6
"""Times of a panel at which the eigenvalues of A(t) are looked at, at the most; of all panels sixteen times as many."""


@dataclass(frozen=True)
class Setting:
    """A method of transition matrices with its order, the number of segments, and why it was taken.

    shares: the part of the segments that each panel of the resolved coefficients gets, where they are not spread evenly;
    rate: the fastest eigenvalue of A(t) in 1/s, where it was looked at.
    """

    method: str
    order: int
    segments: int
    reason: str
    rate: float = 0.0
    shares: tuple[float, ...] = field(default=(), repr=False)

    def __str__(self) -> str:
        if self.method == "hill":
            return f"Hill's matrix with {counted(self.order, 'harmonic')} ({self.reason})"
        if self.method not in METHODS:
            return f"{self.method} ({self.reason})"
        return f"{self.method} of order {self.order} on {counted(self.segments, 'segment')} ({self.reason})"


def find_rule(method: str, order: int) -> Tableau:
    """The tableau of a method of some order."""
    return METHODS[method](-(-order // 2))


def place_segments(system: PeriodicSystem, setting: Setting) -> Array:
    """Edges (K + 1,) of the segments of a period: every panel of the resolved coefficients is divided evenly by its share.

    Raises: TooLarge where the transition matrices over them would not fit.
    """
    corners = system.resolved.edges
    panels = np.diff(corners)
    shares = np.array(setting.shares) if len(setting.shares) == len(panels) else panels / system.period
    counts = np.maximum(1, np.ceil(setting.segments * shares * (1 - 1e-12)).astype(int))
    check_size(
        f"a period of {counts.sum():,} segments for {system.n} states",
        8 * int(counts.sum()) * system.n**2,
        "leave out the fastest modes, or lower the gains behind them",
    )
    return divide_evenly(corners, counts)


def factor_by(system: PeriodicSystem, edges: Array, method: str, order: int) -> Array:
    """Transition matrices (K, n, n) over the segments between consecutive edges. Raises: NumericalError where stages are singular."""
    return factor_segments(system.resolved.series, edges, find_rule(method, order))


def factor_twice(system: PeriodicSystem, setting: Setting) -> tuple[list[Array], Array, Unknown]:
    """As `measure_segments`, by the setting's method and by two stages more, which share no node. Raises: as `factor_by`."""
    rules = find_rule(setting.method, setting.order), find_rule(setting.method, setting.order + 4)
    return measure_segments(system.resolved, place_segments(system, setting), rules)


def factor_period(system: PeriodicSystem, setting: Setting) -> Array:
    """Return the transition matrices (K, n, n) of the segments of one period."""
    return factor_by(system, place_segments(system, setting), setting.method, setting.order)


def report_too_many(wanted: float, limit: int, tol: float) -> TooManySegments:
    """The error of a period that would need more segments than are allowed."""
    return TooManySegments(
        f"tol {tol:.1e} needs about {wanted:.2g} segments of the period",
        got=f"{wanted:.2g}",
        expected=f"at most {limit}",
        todo="ask for a larger tol, leave out the fastest modes, or take coordinates in which A is closer to normal",
    )


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
    each = max(1, min(EIGENVALUE_TIMES, 16 * EIGENVALUE_TIMES // len(length)))
    t = (resolved.edges[:-1, None] + length[:, None] * (np.arange(each) + 0.37) / each).ravel()
    values = np.linalg.eigvals(resolved(t)).reshape(len(length), -1)
    rate = np.maximum(np.abs(values).max(axis=1), 2 * np.pi / system.period)
    return Pace(
        length, rate, np.ptp(values.real, axis=1), count_waves(resolved.series, accuracy), float(values.real.max())
    )


def count_waves(series: Series, accuracy: float) -> Array:
    """The highest harmonic, or for each panel the degree, whose coefficient exceeds the accuracy relative to the entry, (P,)."""
    size = np.abs(series.coefficients)
    if isinstance(series, FourierSeries):
        waves = np.hypot(*series.waves) > accuracy * size.max(axis=0)
        return np.array([1 + np.flatnonzero(waves.any(axis=(1, 2))).max(initial=0)])
    seen = (size > accuracy * size.max(axis=(0, 1))).any(axis=(2, 3))
    return seen.shape[1] - np.argmax(seen[:, ::-1], axis=1)


def choose_setting(
    system: PeriodicSystem, tol: float, method: str = "auto", order: int | None = None, segments: int | None = None
) -> Setting:
    """Fill in what the user left open; the refinement that follows corrects the guess.

    A Gauss step of s stages has the error of the diagonal Pade approximation on the fastest eigenvalue `rate` of A(t),

        error of the exponents ~ rate c (h rate)^(2 s),   c = (s!)^2 / ((2 s)! (2 s + 1)!)

    so h follows from tol and s, and the s of least work is taken. No segment may separate two modes by more than
    GROUP_CONDITION: beyond that its transition matrix cannot hold the weaker one. Those of an L-stable method are so short that it does
    not damp what grows: h times the fastest growth stays below 1/2.
    """
    if method not in ("auto", *METHODS):
        raise ArgumentError("unknown method", got=repr(method), expected=", ".join(["auto", "hill", *METHODS]))
    name = "gauss" if method == "auto" else method
    odd = name == "radau"
    if order is not None and not (order % 2 == odd and order <= 2 * MOST_STAGES):
        expected = f"an {'odd' if odd else 'even'} number up to {2 * MOST_STAGES}"
        raise ArgumentError(f"{name} has no such order", got=order, expected=expected)
    pace, panels = measure_pace(system, 0.01 * tol), system.resolved.panels
    rate = float(pace.rate.max())
    if name == "radau":
        waves, least = NODES_PER_HARMONIC * pace.waves / 5, np.full(panels, 32.0 / panels)
        demand = np.maximum.reduce([2 * pace.length * pace.top, waves, least])
        order, count, reason = order or 9, np.ceil(demand).sum(), "as asked"
    else:
        stages = STAGE_CHOICES if order is None else np.array([order // 2])
        least = np.maximum(pace.length * pace.spread / math.log(GROUP_CONDITION), max(1.0, LEAST_SEGMENTS / panels))
        steps = pace.length / choose_gauss_step(pace.rate, tol, stages[:, None])
        demands = np.maximum(np.maximum(steps, NODES_PER_HARMONIC * pace.waves / stages[:, None]), least)
        counts = np.ceil(demands).sum(axis=1)
        if panels == 1:  # a whole number of lanes costs no more
            counts = LANES * np.ceil(counts / LANES)
        best = int(np.argmin(estimate_work(system, stages, counts)))
        order, demand, count = 2 * int(stages[best]), demands[best], counts[best]
        reason = f"least work for tol {tol:.0e}" if segments is None else "as asked,"
        reason += f" with eigenvalues of A(t) up to {rate:.3g} 1/s"
    shares = tuple((demand / demand.sum()).tolist()) if panels > 1 else ()
    return Setting(name, order, segments or int(count), reason, rate, shares)


def choose_gauss_step(rate: Array, tol: float, stages: Array | int) -> Array:
    """The step at which s Gauss stages reach tol / GUESS_MARGIN on the eigenvalue `rate`."""
    s = np.asarray(stages)
    constant = gamma(s + 1.0) ** 2 / (gamma(2 * s + 1.0) * gamma(2 * s + 2.0))
    return np.asarray((tol / GUESS_MARGIN * np.maximum(1.0, rate) / (rate * constant)) ** (0.5 / s) / rate)


def estimate_work(system: PeriodicSystem, stages: Array | int, segments: Array | int) -> Array:
    """The work, in multiplications: elimination for s stages and for two more, and vectors along the product.

    Unknown at each stage are the states, or the accelerations of a second-order system.
    """
    n, unknowns = system.n, system.n if system.second_order is None else system.n // 2
    sizes = [np.asarray(unknowns * (stages + extra), dtype=float) for extra in (0, 2)]
    solved = sum(size**2 * (size / 3 + n) for size in sizes)
    return np.asarray(segments * (solved + VECTOR_WORK * n**3 + OTHER_WORK))
