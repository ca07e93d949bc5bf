"""How a period is integrated: method, order and number of segments, and the reason for the choice."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NumericalError, TooManySegments
from flexlin.periodic.product.spectrum import Unknown
from flexlin.periodic.system import PeriodicSystem
from flexlin.periodic.transition.factors import factor_segments, measure_segments
from flexlin.periodic.transition.gauss import Tableau, gauss, radau

MAX_SEGMENTS, FEWER_SEGMENTS = 20_000, 4000
"""Of a period at the most, and where another way is open beyond."""


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
            return f"Hill's matrix with {count_words(self.order, 'harmonic')} ({self.reason})"
        if self.method not in METHODS:
            return f"{self.method} ({self.reason})"
        return f"{self.method} of order {self.order} on {count_words(self.segments, 'segment')} ({self.reason})"

    def with_segments(self, segments: int) -> "Setting":
        return replace(self, segments=segments)


def count_words(count: int, thing: str) -> str:
    """A count with its noun: 1 segment, 2 segments."""
    return f"{count} {thing}" if count == 1 else f"{count} {thing}s"


METHODS: dict[str, Callable[[int], Tableau]] = {
    "gauss": lambda order: gauss(order // 2),
    "radau": lambda order: radau((order + 1) // 2),
}
"""Each: order -> stages."""
ORDERS = {"gauss": range(2, 65, 2), "radau": range(1, 32, 2)}


def place_segments(system: PeriodicSystem, setting: Setting) -> Array:
    """Edges (K + 1,) of the segments of a period: every panel of the resolved coefficients is divided evenly by its share."""
    corners = system.resolved.edges
    panels = np.diff(corners)
    shares = np.array(setting.shares) if len(setting.shares) == len(panels) else panels / system.period
    counts = np.maximum(1, np.ceil(setting.segments * shares * (1 - 1e-12)).astype(int))
    which = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(np.repeat(corners[:-1], counts) + np.repeat(panels / counts, counts) * which, corners[-1])


def factor_by(system: PeriodicSystem, edges: Array, method: str, order: int) -> Array:
    """Transition matrices (K, n, n) over the segments between consecutive edges. Raises: NumericalError where stages are singular."""
    with determined(edges):
        return factor_segments(system.resolved, edges, METHODS[method](order))


def factor_twice(system: PeriodicSystem, edges: Array, setting: Setting) -> tuple[list[Array], Array, Unknown]:
    """As `measure_segments`, by the setting's method and by two stages more, which share no node. Raises: as `factor_by`."""
    rule = METHODS[setting.method]
    with determined(edges):
        return measure_segments(system.resolved, edges, (rule(setting.order), rule(setting.order + 4)))


@contextmanager
def determined(edges: Array) -> Iterator[None]:
    """NumericalError where a segment is too long for its stages."""
    try:
        yield
    except np.linalg.LinAlgError:
        raise NumericalError(
            "the stages of a segment are not determined: it is too long for A(t)",
            got=f"{len(edges) - 1} segments",
            todo="ask for more segments, or leave method and segments to the solver",
        ) from None


def factor_period(system: PeriodicSystem, setting: Setting) -> tuple[Array, Array]:
    """Return the edges (K + 1,) and the transition matrices (K, n, n) of one period."""
    grid = place_segments(system, setting)
    return grid, factor_by(system, grid, setting.method, setting.order)


def report_too_many(wanted: float, limit: int, tol: float) -> TooManySegments:
    """The error of a period that would need more segments than are allowed."""
    return TooManySegments(
        f"tol {tol:.1e} needs about {wanted:.2g} segments of the period",
        got=f"{wanted:.2g}",
        expected=f"at most {limit}",
        todo="ask for a larger tol, leave out the fastest modes, or take coordinates in which A is closer to normal",
    )
