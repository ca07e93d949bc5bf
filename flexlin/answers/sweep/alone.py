"""Values that are computed one by one: loops that are designed or derived anew at each, and those of many states."""

from dataclasses import dataclass
from functools import partial

from flexlin.about.free import ParametricLoop
from flexlin.answers.loops import AnyLoop
from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.plan import Plan
from flexlin.checks import Array

TOGETHER, WIDE = 25, 8
"""Up to so many values of a loop with so many states or more are computed one by one: a batch's pilot alone would take longer."""
VERY_WIDE = 16
"""With so many states or more all are, unless code is compiled for them: `floquet` separates fast modes from slow ones, a batch divides
the period for the fastest and takes ten times as long."""


def prefers_one_by_one(loop: ParametricLoop, values: int) -> bool:
    """Whether `floquet` takes less time than NumPy's batches."""
    few = values <= TOGETHER and loop.states >= WIDE and loop.linearization.complete
    return few or loop.states >= VERY_WIDE


@dataclass(frozen=True)
class OneByOne:
    """The computation of values by `floquet`."""

    loop: AnyLoop
    tol: float
    block: int = 4
    route = "one by one"
    threaded = False

    @property
    def plan(self) -> Plan:
        """No segments are chosen for all together."""
        return Plan(0)

    def compute(self, points: Array) -> Found:
        """All values of a block."""
        found = Found.empty(len(points), self.loop.states)
        for i, point in enumerate(points):
            found.put_alone(i, partial(self.loop.system_at, point), self.tol)
        return found
