"""The table of accuracy against time."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

from flexlin.summary import represent

STAGES = (
    "coefficients", "transition matrices", "exponents", "periodic Riccati", "forced response", "number of modes", "Taylor order",
)  # fmt: skip
DECADES = tuple(10.0**-k for k in range(2, 13))


@dataclass(frozen=True)
class Row:
    """One setting of one method: its error, its time in s, and the tolerance at which the engine chooses it by itself.

    `outside`: the method is another program's. `cheapest`: nothing of flexlin's own in this stage is as accurate in less time.
    """

    stage: str
    method: str
    setting: str
    error: float
    seconds: float
    chosen: str = ""
    outside: bool = False
    cheapest: bool = False


@dataclass(frozen=True)
class CostResult:
    """All rows, and what the errors are measured against.

    Errors are relative to the largest entry, of exponents to max(1, |exponent|); below `floor` the reference itself is not known better.
    """

    title: str
    rows: tuple[Row, ...]
    floor: float
    notes: tuple[str, ...] = ()

    __repr__ = represent

    def stage(self, name: str) -> tuple[Row, ...]:
        """The rows of one stage."""
        return tuple(row for row in self.rows if row.stage == name)

    def cheapest(self, stage: str, accuracy: float) -> Row | None:
        """The fastest of flexlin's own settings that reaches an accuracy, if one does."""
        good = [row for row in self.stage(stage) if not row.outside and row.error <= accuracy]
        return min(good, key=lambda row: row.seconds, default=None)

    def recommendations(self) -> Iterator[tuple[str, float, Row]]:
        """(stage, accuracy, cheapest row) for each decade of accuracy at which the answer changes."""
        for stage in STAGES:
            last = None
            for accuracy in DECADES:
                row = self.cheapest(stage, accuracy)
                if row is not None and row != last:
                    yield stage, accuracy, row
                last = row

    def marked(self) -> "CostResult":
        """The same rows with `cheapest` set on those that no own row beats in both error and time."""
        rows = tuple(replace(row, cheapest=not row.outside and not self._beaten(row)) for row in self.rows)
        return replace(self, rows=rows)

    def _beaten(self, row: Row) -> bool:
        return any(
            other.seconds < row.seconds and max(other.error, self.floor) <= max(row.error, self.floor)
            for other in self.stage(row.stage)
            if not other.outside
        )

    def record(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        rows = [asdict(row) for row in self.rows]
        return {"schema": 1, "title": self.title, "floor": self.floor, "notes": list(self.notes), "rows": rows}
