"""Values that are computed together by the kernel: how it is prepared, and one block of them."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.later import Later
from flexlin.answers.sweep.needs import FEW, MOST, ORDER, STEPS, Needs, find_rungs, learn_needs, pack
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.many.kernel import MULTIPLES, SIZES, WIDTH, Kernel, Logs

if TYPE_CHECKING:
    from flexlin.about.family import PeriodicFamily
    from flexlin.about.free import ParametricLoop

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
    """The computation of blocks of values by the kernel; `scale` balances the states; `needs` says on how many segments.

    `given`: the system, for values that are computed one by one; `may_be_narrow`: whether its coefficients may have narrow features.
    Where neither is asked for, a worker loads NumPy and the compiled core alone.
    """

    given: "Later[ParametricLoop | PeriodicFamily]"
    may_be_narrow: bool
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
        from flexlin.about.kernel_model import make_kernel

        try:
            kernel = make_kernel(source)
        except ArgumentError:
            return None
        if kernel.model.size not in SIZES:
            return None
        scale = kernel.balance(points[spread_over(len(points), 3 * WIDTH)])
        needs = learn_needs(kernel, points, scale, tol)
        made = cls(Later(source), source.may_be_narrow, tol, kernel, scale, needs, len(points))
        if needs.usual >= MOST or not (source.is_smooth or made.is_confirmed(points)):
            return None
        return made

    def is_confirmed(self, points: Array) -> bool:
        """Whether `floquet` agrees at a few values."""
        chosen = points[spread_over(len(points), WITNESSES)]
        found, alone = self.compute(chosen), Found.empty(len(chosen), self.kernel.model.states)
        for i, point in enumerate(chosen):
            alone.put_alone(i, partial(self.source.system_at, point), self.tol)
        return all(found.agrees(alone, i) for i in range(len(chosen)))

    @property
    def source(self) -> "ParametricLoop | PeriodicFamily":
        """What is asked about."""
        return self.given.value

    @property
    def segments(self) -> int:
        """The number of segments in the middle of the parameters."""
        return self.needs.usual

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

        def enter(which: Array, logs: Logs) -> Array:
            misses = logs.misses(self.tol)
            met, T = misses <= 1, logs.periods[:, None]
            found.put(which[met], (logs.logs / T)[met], (logs.errors / T)[met])
            found.period[which[met]] = logs.periods[met]
            return misses

        left = self.solve(points, np.flatnonzero(~narrow), enter)
        for i in (*np.flatnonzero(narrow), *left):
            found.put_alone(i, partial(self.source.system_at, points[i]), self.tol)
        return found

    def solve(self, points: Array, rest: Array, enter: Callable[[Array, Logs], Array]) -> Array:
        """Compute values on more and more segments until `enter`, which takes them, says that errors are 1 or less; return the others."""
        rungs, spread, levels, alone = self.needs.predict(points[rest]), SLACK * self.needs.spread, FEW, [rest[:0]]
        least = STEPS[0]
        while len(rest):
            misses, used = np.empty(len(rest)), np.empty(len(rest))
            for segments, which in pack(rungs):
                given = (segments, self.scale, self.tol / 100, spread, self.tol, levels)
                misses[which] = enter(rest[which], self.kernel.find_logs(points[rest[which]], *given))
                used[which] = segments
            missed = misses > 1
            rest, wanted = rest[missed], used[missed] * np.clip(misses[missed] ** (1 / ORDER), least, STEPS[1])
            alone.append(rest[wanted > MOST])
            rest, rungs = rest[wanted <= MOST], find_rungs(wanted[wanted <= MOST])
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
