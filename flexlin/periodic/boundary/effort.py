"""What a search along one parameter may take, what its spectra cost, and what it had to leave out."""

from flexlin.checks import Array
from flexlin.periodic.boundary.spectra import Spectra, SpectraFunction
from flexlin.resources import Stopwatch

SCAN = 0.6
"""Share of the time that the scan may take: the rest is for the places that it finds."""


class Effort:
    """Seconds of work for a search, by default without end; `gap`: the widest part of the range in which a change may hide, 0 where none
    can but in what the search cannot see; `unfinished`: whether a place was not narrowed as far as was asked."""

    def __init__(self, seconds: float = float("inf")):
        self.seconds, self.watch, self.gap, self.unfinished, self.values = seconds, Stopwatch(), 0.0, False, 0
        self._each = 0.0

    def counted(self, function: SpectraFunction) -> SpectraFunction:
        """The function, whose cost for each value is known from its latest call, but for the first one, which may prepare something."""

        def compute(values: Array) -> Spectra:
            before = self.watch.seconds
            found = function(values)
            if self.values:
                self._each = (self.watch.seconds - before) / max(len(values), 1)
            self.values += len(values)
            return found

        return compute

    def affords(self, values: int, share: float = 1.0) -> bool:
        """Whether so many values more are done within a share of the time."""
        return self.watch.seconds + values * self._each <= share * self.seconds
