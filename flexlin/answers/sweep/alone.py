"""Values that are computed one by one: loops that are designed or derived anew at each."""

from dataclasses import dataclass
from functools import partial

from flexlin.answers.loops import RebuiltLoop, RedesignedLoop
from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.plan import Plan
from flexlin.checks import Array


@dataclass(frozen=True)
class OneByOne:
    """The computation of values by `floquet`."""

    loop: RedesignedLoop | RebuiltLoop
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
