"""Values that are computed one by one: loops that are designed or derived anew at each, and those for which there is no kernel."""

from dataclasses import dataclass
from functools import partial

from flexlin.about.family import PeriodicFamily
from flexlin.answers.loops import AnyLoop
from flexlin.answers.sweep.found import Found
from flexlin.checks import Array


@dataclass(frozen=True)
class OneByOne:
    """The computation of values by `floquet`."""

    source: AnyLoop | PeriodicFamily
    tol: float
    block: int = 4
    route = "one by one"
    threaded = False

    @property
    def segments(self) -> int:
        """None are chosen for all values together."""
        return 0

    def compute(self, points: Array) -> Found:
        """All values of a block."""
        found = Found.empty(len(points), self.source.states)
        for i, point in enumerate(points):
            found.put_alone(i, partial(self.source.system_at, point), self.tol)
        return found
