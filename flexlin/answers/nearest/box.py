"""Uncertain numbers as changes from the scene's own: 0 there, 1 at the ends that are stated."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from flexlin.answers.spectra import Family, Source, make_family
from flexlin.answers.sweep.job import check_axes
from flexlin.checks import Array
from flexlin.errors import ArgumentError, InputError
from flexlin.lazy import lazy
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.scene.scene import Scene

FURTHEST = (4.0, 3.0, 2.0, 1.5, 1.0)
"""Multiples of the stated changes up to which is searched: the first that the scene's schema accepts, on each side of each number."""
STEP = 1e-6
"""Of the differences that stand for exact slopes where a loop is a function."""

Ranges = Mapping[str, tuple[float, float]]


@dataclass
class Box:
    """Numbers by their changes u: own at 0, the ends at -1 and +1; no further than `most` (2, P), down and up."""

    family: Family
    paths: tuple[str, ...]
    own: Array
    low: Array
    high: Array
    most: Array
    known: dict[bytes, FloquetResult] = field(default_factory=dict)

    @lazy
    def furthest(self) -> float:
        """The largest multiple that is tried."""
        return float(self.most.max())

    def values(self, u: Array) -> Array:
        """The numbers (..., P) at changes (..., P)."""
        u = np.clip(u, -self.most[0], self.most[1])
        return np.asarray(self.own + np.abs(u) * (np.where(u < 0, self.low, self.high) - self.own))

    def judge(self, u: Array) -> FloquetResult:
        """The exponents at one place."""
        return self.judge_numbers(self.values(u))

    def judge_numbers(self, values: Array) -> FloquetResult:
        """The exponents with these numbers, computed once."""
        key = values.tobytes()
        if key not in self.known:
            self.known[key] = floquet(self.family.system_at(values))
        return self.known[key]

    def growth(self, u: Array) -> float:
        """The growth rate at one place, in 1/s."""
        return self.growth_of(self.values(u))

    def growth_of(self, values: Array) -> float:
        """The growth rate with these numbers, in 1/s."""
        return float(self.judge_numbers(values).exponents[0].real)

    def gradient(self, u: Array) -> Array:
        """The growth rate's derivatives by the numbers (P,): exact, or by differences where the loop is a function."""
        values = self.values(u)
        found = self.family.slopes(values)
        if found is not None:
            exponents, _, derivative = found
            return np.asarray(derivative[:, int(np.argmax(exponents.real))].real)
        steps = STEP * (self.high - self.low)
        ahead = [self.growth_of(values + one) for one in np.diag(steps)]
        return np.asarray((np.array(ahead) - self.growth(u)) / steps)

    def slope(self, u: Array) -> Array:
        """The growth rate's derivatives by u (P,), on the side of each number on which u is."""
        return np.asarray(self.gradient(u) * np.where(u < 0, self.own - self.low, self.high - self.own))

    def uphill(self) -> Array:
        """For each number the side of the scene's own, -1 or 1, to which the growth rate rises more."""
        gradient = self.gradient(np.zeros(len(self.own)))
        return np.where(gradient * (self.low - self.own) > gradient * (self.high - self.own), -1.0, 1.0)


def list_ranges(source: Source, ranges: Ranges | None) -> dict[str, tuple[float, float]]:
    """The ranges that are given, or those of the scene."""
    if ranges is not None:
        return {path: (float(low), float(high)) for path, (low, high) in ranges.items()}
    known = source.uncertainty if isinstance(source, Scene) else {}
    return {path: (one.low, one.high) for path, one in known.items()}


def make_box(
    source: Source,
    ranges: Ranges | None = None,
    loop: str = "own",
    own: Sequence[float] | None = None,
    furthest: float = FURTHEST[0],
) -> Box:
    """The numbers with their ends, by default those of the scene's table [uncertainty], as far as its schema lets them go.

    Raises: ArgumentError where no ranges are known, they do not hold the loop's own numbers, or a path leads to no free number.
    """
    ends = list_ranges(source, ranges)
    if not ends:
        raise ArgumentError("no range is known", expected="ranges, or a table [uncertainty] in the scene")
    family = make_family(source, ends, loop)
    if not isinstance(source, Scene):
        family.own = np.asarray(np.nan if own is None else own, dtype=float)
    low, high = np.array(list(ends.values())).T
    need_own_inside(ends, family.own)
    most = np.full((2, len(ends)), furthest)
    if isinstance(source, Scene):
        for i, path in enumerate(ends):
            most[:, i] = [allowed(source, path, family.own[i], end[i], furthest) for end in (low, high)]
    return Box(family, tuple(ends), family.own, low, high, most)


def need_own_inside(ends: dict[str, tuple[float, float]], own: Array) -> None:
    """Refuse ranges that do not hold the loop's own numbers. Raises: ArgumentError."""
    for (path, (low, high)), value in zip(ends.items(), np.broadcast_to(own, len(ends)), strict=True):
        if not (low <= value <= high and low < high):
            raise ArgumentError(
                f"the range of {path} does not hold the loop's own number",
                got=f"{low:g} to {high:g}",
                expected=f"{value:g} between them" if np.isfinite(value) else "own numbers, one for each range",
            )


def allowed(scene: Scene, path: str, own: float, end: float, furthest: float) -> float:
    """The multiple of a number's change to one end up to which the schema accepts it."""
    for size in (min(one, furthest) for one in FURTHEST):
        try:
            check_axes(scene, {path: np.array([own, own + size * (end - own)])}, grid=True)
        except InputError:
            continue
        return size
    return 1.0
