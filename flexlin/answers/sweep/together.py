"""Values that are computed together by the kernel: how it is prepared, and one block of them."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.answers.sweep.found import Found
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.many import MULTIPLES, SIZES, WIDTH, Kernel, Logs, measure_spread
from flexlin.progress import advance

if TYPE_CHECKING:
    from flexlin.about.family import PeriodicFamily
    from flexlin.about.free import ParametricLoop


FEWEST, MOST = 4, 1024
"""The least and the largest number of segments; the resolutions are multiples of them."""
FINENESS = 2
"""Numbers of segments that a value may want, in a factor of two: those that want the same are computed together."""
FEW = 3
"""Resolutions of a first trial."""
ORDER = 8
"""Of the extrapolated logs, by the length of the segments."""
STEPS = 1.15, 2.0
"""Factors between the numbers of segments of a value's trials."""
PILOTS = 3 * WIDTH
"""Values spread over all, by which the states are balanced and the first number of segments is chosen."""
SLACK = 1.1
"""The spread of the moduli may exceed the pilots' by this factor."""
BLOCK = 65536
"""Values of a block at the most, times the square of the states: in a larger one more are alike, but it is seen later."""
BLOCKS, SMALL_BLOCK = 8, 12 * WIDTH
"""Blocks that a sweep is cut into at the least, unless they are smaller than this."""
WITNESSES = 3
"""Values of a family at which `floquet`, which looks for what is narrow, has to say what the kernel says."""


@dataclass(frozen=True)
class Together:
    """The computation of blocks of values by the kernel; `scale` balances the states; `segments`: how many are tried first.

    `source`: the system, for values that are computed one by one; `may_be_narrow`: whether its coefficients may have narrow features;
    `spread`: of the logs of the pilots' moduli.
    """

    source: "ParametricLoop | PeriodicFamily"
    may_be_narrow: bool
    tol: float
    kernel: Kernel
    scale: Array
    values: int
    segments: int = FEWEST
    spread: float = np.inf
    route = "together"

    @classmethod
    def prepare(cls, source: "ParametricLoop | PeriodicFamily", points: Array, tol: float) -> "Together | None":
        """Record the model and choose numbers of segments on a few values; None where `floquet` is what serves.

        There is a kernel for a list of sizes; stiff systems may need more segments than it takes, and narrow features are not seen.
        """
        from flexlin.about.kernel_model import make_kernel

        try:
            kernel = make_kernel(source)
        except ArgumentError:
            return None
        if kernel.model.size not in SIZES:
            return None
        if source.may_be_narrow and all(map(source.is_narrow, points[spread_over(len(points), WIDTH)])):
            return None
        pilots = points[spread_over(len(points), PILOTS)]
        made = cls(source, source.may_be_narrow, tol, kernel, kernel.balance(pilots), len(points))
        made = replace(made, **made.choose_segments(pilots))
        if made.segments >= MOST or not (source.is_smooth or made.is_confirmed(points)):
            return None
        return made

    def choose_segments(self, pilots: Array) -> dict[str, Any]:
        """The number of segments on which half of the pilots (K, P) meet the tolerance, and the spread of the logs of their moduli."""
        needed, spreads = np.full(len(pilots), float(MOST)), [-np.inf]

        def enter(which: Array, logs: Logs, segments: int) -> Array:
            misses = logs.misses(self.tol)
            met = misses <= 1
            needed[which[met]] = segments * np.maximum(misses[met] ** (1 / ORDER), 1 / STEPS[1])
            spreads.append(measure_spread(logs.logs[met]) if met.any() else -np.inf)
            return misses

        self.solve(pilots, np.arange(len(pilots)), enter)
        middle = float(np.sort(needed)[len(needed) // 2])
        return {
            "segments": max(FEWEST, math.ceil(middle)),
            "spread": max(spreads) if np.isfinite(max(spreads)) else np.inf,
        }

    def is_confirmed(self, points: Array) -> bool:
        """Whether `floquet` agrees at a few values."""
        chosen = points[spread_over(len(points), WITNESSES)]
        found, alone = self.compute(chosen), Found.empty(len(chosen), self.kernel.model.states)
        for i, point in enumerate(chosen):
            alone.put_alone(i, partial(self.source.system_at, point), self.tol)
        return all(found.agrees(alone, i) for i in range(len(chosen)))

    @property
    def threaded(self) -> bool:
        """All values are computed by the kernel, which lets other threads work meanwhile."""
        return not self.may_be_narrow

    @property
    def block(self) -> int:
        """Values of a block: as many whatever machine or worker computes it, so that results do not depend on where the cuts are."""
        shared = max(SMALL_BLOCK, self.values // BLOCKS)
        return WIDTH * max(1, min(shared, BLOCK // self.kernel.model.states**2) // WIDTH)

    def compute(self, points: Array) -> Found:
        """All values of a block: together, and those that are narrow or miss tol one by one."""
        found = Found.empty(len(points), self.kernel.model.states)
        narrow = self.find_narrow(points)

        def enter(which: Array, logs: Logs, _: int) -> Array:
            misses = logs.misses(self.tol)
            met, T = misses <= 1, logs.periods[:, None]
            found.put(which[met], (logs.logs / T)[met], (logs.errors / T)[met])
            found.period[which[met]] = logs.periods[met]
            return misses

        left = self.solve(points, np.flatnonzero(~narrow), enter)
        for i in (*np.flatnonzero(narrow), *left):
            advance(float(np.isfinite(found.error).mean()))
            found.put_alone(i, partial(self.source.system_at, points[i]), self.tol)
        return found

    def solve(self, points: Array, rest: Array, enter: Callable[[Array, Logs, int], Array]) -> Array:
        """Compute values on more and more segments until `enter`, which takes both, says that errors are 1 or less; return the others."""
        wanted, spread, levels = np.full(len(rest), self.segments), SLACK * self.spread, FEW
        least, alone = STEPS[0], [rest[:0]]
        while len(rest):
            misses = np.empty(len(rest))
            for segments in map(int, np.unique(wanted)):
                which = np.flatnonzero(wanted == segments)
                given = segments, self.scale, self.tol / 100, spread, self.tol, levels
                misses[which] = enter(rest[which], self.kernel.find_logs(points[rest[which]], *given), segments)
            alone.append(rest[(misses > 1) & (wanted >= MOST)])
            again = (misses > 1) & (wanted < MOST)
            more = np.log2(wanted[again] * np.clip(misses[again] ** (1 / ORDER), least, STEPS[1]))
            rest, wanted = rest[again], np.ceil(2 ** (np.ceil(FINENESS * more) / FINENESS)).clip(max=MOST).astype(int)
            if least == STEPS[1]:
                levels = len(MULTIPLES)
            spread, least = np.inf, STEPS[1]  # moduli may lie further apart than the pilots'
        return np.concatenate(alone)

    def find_narrow(self, points: Array) -> Array:
        """Which values have coefficients with narrow features, which the kernel would step over, (V,)."""
        if not self.may_be_narrow:
            return np.zeros(len(points), dtype=bool)
        return np.array([self.source.is_narrow(point) for point in points], dtype=bool)


def spread_over(values: int, some: int) -> Array:
    """Places of some values among all."""
    return np.unique(np.linspace(0, values - 1, some).round().astype(int))
