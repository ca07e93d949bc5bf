"""Values that are computed together by the kernel: how it is prepared, and one block of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from flexlin.analyses.sweep.found import Found
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.many import MULTIPLES, WIDTH, Kernel, Logs, measure_spread
from flexlin.resources import advance

if TYPE_CHECKING:
    from flexlin.linearization.family import PeriodicFamily
    from flexlin.linearization.free import ParametricLoop


FEWEST_SEGMENTS, MOST_SEGMENTS = 4, 1024
"""Least and largest number of segments among which is chosen."""
SEGMENT_NUMBERS = np.unique(np.geomspace(FEWEST_SEGMENTS, MOST_SEGMENTS, 97).round().astype(int))
"""The numbers themselves, twelve in a factor of two; the resolutions are multiples of them."""
TRIAL_RESOLUTIONS = 3
"""Resolutions of a first trial."""
LOG_ORDER = 8
"""Of the extrapolated logs, by the length of the segments."""
SEGMENT_FACTORS = 1.15, 2.0
"""Factors between the numbers of segments of a value's trials."""
PILOT_MARGIN = 1.06
"""What values are given over what pilots needed: a second trial costs more."""
PILOT_VALUES = 8, 256
"""Least and largest number of values that are tried, one of 64 between them: a trial of one costs as much as three of the values."""


@dataclass
class Needs:
    """What pilots (K, P) needed, as places in SEGMENT_NUMBERS (K,); `spread`: of the logs of their moduli."""

    pilots: Array
    rungs: Array
    spread: float

    def predict(self, points: Array) -> Array:
        """Places in SEGMENT_NUMBERS for points (V, P): the largest of the P + 1 nearest pilots', by how many pilots lie between."""
        near = min(points.shape[1] + 1, len(self.rungs))
        _, nearest = cKDTree(self.count_between(self.pilots)).query(self.count_between(points), near)
        return np.asarray(self.rungs[nearest.reshape(len(points), near)].max(axis=1))

    def count_between(self, points: Array) -> Array:
        """Points (V, P) by how many values of the pilots lie before each number."""
        steps = [np.unique(known) for known in self.pilots.T]
        places = [np.interp(np.nan_to_num(x), one, np.arange(len(one))) for x, one in zip(points.T, steps, strict=True)]
        return np.stack(places, axis=1)

    @property
    def usual(self) -> int:
        """The number of segments that a pilot needs in the middle."""
        return int(SEGMENT_NUMBERS[np.sort(self.rungs)[len(self.rungs) // 2]])


def find_rungs(wanted: Array) -> Array:
    """The least places in SEGMENT_NUMBERS with as many segments as wanted."""
    return np.searchsorted(SEGMENT_NUMBERS, wanted * (1 - 1e-9)).clip(max=len(SEGMENT_NUMBERS) - 1)


def pack(rungs: Array) -> Iterator[tuple[int, Array]]:
    """Segments and which values (V,) to compute on them: eight that want about as many are one vector, and have what the last one wants.

    Values that want as many stay in order: neighbours have much in common, and a vector takes as long as its slowest value.
    """
    order = np.argsort(rungs, kind="stable")
    last = np.minimum(np.arange(WIDTH - 1, len(order) + WIDTH - 1, WIDTH), len(order) - 1)
    of_vectors = rungs[order[last]]
    for rung in np.unique(of_vectors):
        vectors = np.flatnonzero(of_vectors == rung)
        yield int(SEGMENT_NUMBERS[rung]), order[WIDTH * vectors[0] : WIDTH * (vectors[-1] + 1)]


def learn_needs(kernel: Kernel, points: Array, scale: Array, tol: float) -> Needs:
    """What values spread over the points (V, P) need."""
    count = np.arange(np.clip(len(points) // 64, *PILOT_VALUES))
    pilots = points[np.unique((count * 0.6180339887498949 % 1.0 * len(points)).astype(int))]
    needs, spread = try_pilots(kernel, pilots, scale, tol)
    met = np.isfinite(pilots).all(axis=1) & np.isfinite(needs)
    if not met.any():
        return Needs(np.zeros((1, points.shape[1])), np.array([len(SEGMENT_NUMBERS) - 1]), spread)
    return Needs(pilots[met], find_rungs(PILOT_MARGIN * needs[met]), spread)


def try_pilots(kernel: Kernel, pilots: Array, scale: Array, tol: float) -> tuple[Array, float]:
    """Segments (V,) on which each pilot just meets tol, infinite where none does, and the spread of the logs of their moduli."""
    needs, spread = np.full(len(pilots), np.inf), -np.inf
    wanted = np.full(len(pilots), float(FEWEST_SEGMENTS))
    left = np.arange(len(pilots))
    while len(left):
        left = left[np.argsort(wanted[left], kind="stable")]
        segments = int(wanted[left[0]])
        now = left[wanted[left] <= SEGMENT_FACTORS[0] * segments]
        segments = int(wanted[now].max())
        found = kernel.find_logs(pilots[now], segments, scale, tol / 100, np.inf, np.inf, TRIAL_RESOLUTIONS)
        misses = found.misses(tol)
        growth = misses ** (1 / LOG_ORDER)
        met = misses <= 1
        needs[now[met]] = np.maximum(segments * growth[met], segments / SEGMENT_FACTORS[1])
        if met.any():
            spread = max(spread, measure_spread(found.logs[met]))
        wanted[now] = np.ceil(segments * np.clip(growth, *SEGMENT_FACTORS))
        known = needs[np.isfinite(needs)]
        # who needs far more than the others is given up
        most = min(MOST_SEGMENTS, SEGMENT_FACTORS[1] ** 2 * known.max(initial=0.0) or MOST_SEGMENTS)
        left = left[np.isinf(needs[left]) & (wanted[left] <= most)]
    return needs, spread if np.isfinite(spread) else np.inf


SPREAD_SLACK = 1.1
"""The spread of the moduli may exceed the pilots' by this factor."""
BLOCK_VALUES = 65536
"""Values of a block at the most, times the square of the states: in a larger one more are alike, but it is seen later."""


@dataclass(frozen=True)
class Together:
    """The computation of blocks of values by the kernel; `scale` balances the states; `needs` says on how many segments.

    `source`: the system, for values that are computed one by one.
    """

    source: "ParametricLoop | PeriodicFamily"
    tol: float
    kernel: Kernel
    scale: Array
    needs: Needs
    values: int
    route = "together"

    @classmethod
    def prepare(cls, source: "ParametricLoop | PeriodicFamily", points: Array, tol: float) -> "Together | None":
        """Record the model and choose numbers of segments on a few values; None where `floquet` is what serves.

        There is a kernel for a list of sizes; stiff systems may need more segments than it takes, and narrow features are not seen.
        """
        from flexlin.linearization.free import make_kernel

        try:
            kernel = make_kernel(source)
        except ArgumentError:
            return None
        if source.may_be_narrow and all(map(source.is_narrow, points[spread_over(len(points), WIDTH)])):
            return None
        scale = kernel.balance(points[spread_over(len(points), 3 * WIDTH)])
        needs = learn_needs(kernel, points, scale, tol)
        made = cls(source, tol, kernel, scale, needs, len(points))
        if needs.usual >= MOST_SEGMENTS or not (source.is_smooth or made.is_confirmed(points)):
            return None
        return made

    def is_confirmed(self, points: Array) -> bool:
        """Whether `floquet`, which looks for what is narrow, says what the kernel says at both ends and in the middle."""
        chosen = points[spread_over(len(points), 3)]
        found = self.compute(chosen)
        return all(
            found.is_confirmed(i, partial(self.source.system_at, point), self.tol) for i, point in enumerate(chosen)
        )

    @property
    def segments(self) -> int:
        """The number of segments in the middle of the parameters."""
        return self.needs.usual

    @property
    def threaded(self) -> bool:
        """All values are computed by the kernel, which lets other threads work meanwhile."""
        return not self.source.may_be_narrow

    @property
    def block(self) -> int:
        """Values of a block: an eighth of all, or twelve vectors; as many wherever it is computed: no result depends on the cuts."""
        shared = max(12 * WIDTH, self.values // 8)
        return WIDTH * max(1, min(shared, BLOCK_VALUES // self.kernel.model.states**2) // WIDTH)

    def compute(self, points: Array) -> Found:
        """All values of a block: together, and those that are narrow or miss tol one by one."""
        found = Found.empty(len(points), self.kernel.model.states)

        def enter(which: Array, logs: Logs) -> Array:
            misses = logs.misses(self.tol)
            met, T = misses <= 1, logs.periods[:, None]
            found.put(which[met], logs.logs[met] / T[met], logs.errors[met] / T[met])
            found.period[which[met]] = logs.periods[met]
            return misses

        for i in self.solve(points, enter):
            advance(float(np.isfinite(found.error).mean()))
            found.put_alone(i, partial(self.source.system_at, points[i]), self.tol)
        return found

    def solve(self, points: Array, enter: Callable[[Array, Logs], Array]) -> Array:
        """Compute values on more and more segments until `enter`, which takes them, says that errors are 1 or less; return the others, and
        those whose coefficients have narrow features, which the kernel would step over."""
        narrow = np.zeros(len(points), dtype=bool)
        if self.source.may_be_narrow:
            narrow[:] = [self.source.is_narrow(point) for point in points]
        rest, alone = np.flatnonzero(~narrow), [np.flatnonzero(narrow)]
        rungs, spread = self.needs.predict(points[rest]), SPREAD_SLACK * self.needs.spread
        levels, least = TRIAL_RESOLUTIONS, SEGMENT_FACTORS[0]
        while len(rest):
            misses, used = np.empty(len(rest)), np.empty(len(rest))
            for segments, which in pack(rungs):
                given = (segments, self.scale, self.tol / 100, spread, self.tol, levels)
                misses[which] = enter(rest[which], self.kernel.find_logs(points[rest[which]], *given))
                used[which] = segments
            wanted = used * np.clip(misses ** (1 / LOG_ORDER), least, SEGMENT_FACTORS[1])
            again = (misses > 1) & (used < MOST_SEGMENTS)
            alone.append(rest[~again & ~(misses <= 1)])
            rest, rungs = rest[again], find_rungs(np.minimum(wanted[again], MOST_SEGMENTS))
            if least == SEGMENT_FACTORS[1]:
                levels = len(MULTIPLES)
            spread, least = np.inf, SEGMENT_FACTORS[1]  # moduli may lie further apart than the pilots'
        return np.sort(np.concatenate(alone))


def spread_over(values: int, some: int) -> Array:
    """Places of some values among all."""
    return np.unique(np.linspace(0, values - 1, some).round().astype(int))
