"""How accurate the answers should be, and what they may cost."""

from typing import Annotated

from pydantic import Field

from flexlin.resources import BYTES, PATIENCE, SECONDS
from flexlin.scene.base import Table, Unit

FINEST, COARSEST = 1e-15, 0.1
"""Rounding allows no smaller error; a larger one is no answer."""
COMPARED = 1e-6
"""The error of a report's nonlinear check where no tol is given: a thousandth of the smallest difference that such a check speaks of."""

CLOSING, MOST, LEAST = 0.2, 30.0, 1.5
"""Share of the time that is kept for drawing and writing what was found, and its limits in s."""


class Accuracy(Table):
    """What is asked of every stage of the work, an error, and what all of them together may take.

    tol: wanted error of each stage's answer, as the stage measures it (exponents in 1/s, relative beyond 1/s; gains, responses and
    simulations relative); seconds: time of the processor that a run may take, and so each of its stages, and by the clock as much where
    it is given; memory: bytes that a run may hold beside its libraries, which take some 200 MB, and so what a stage may ask for at once.
    """

    tol: Annotated[float, Field(strict=True, ge=FINEST, le=COARSEST)] = 1e-9
    """Wanted error of each stage's answer; left out, the nonlinear check of a report is asked for 1e-6."""
    seconds: Annotated[float, Field(strict=True, gt=0, le=1e7), Unit("s")] = SECONDS
    """Time of the processor that a run may take; given, it limits the clock too, else other programs may make it wait."""
    memory: Annotated[float, Field(strict=True, ge=2.0**20, le=2.0**50), Unit("B")] = BYTES
    """Memory that a run may hold beside its libraries: with these less than 1 GB."""

    @property
    def stages_end(self) -> float:
        """When all stages but the last are over, in s after the begin."""
        return self.seconds - min(CLOSING * self.seconds, MOST)

    @property
    def last_end(self) -> float:
        """When everything is: after its time; where that is short, after what drawing and writing needs."""
        return max(self.seconds, self.stages_end + LEAST)

    @property
    def patience(self) -> float:
        """Seconds of the clock for each of the processor."""
        return 1.0 if "seconds" in self.model_fields_set else PATIENCE

    @property
    def of_comparison(self) -> "Accuracy":
        """What a comparison of linear and nonlinear motion is asked for: tol if the user gave one, else COMPARED."""
        return self if "tol" in self.model_fields_set else self.model_copy(update={"tol": COMPARED})
