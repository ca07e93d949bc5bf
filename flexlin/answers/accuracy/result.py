"""The table of accuracy against time."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

from flexlin.summary import represent

STAGES = (
    "coefficients", "transition matrices", "exponents", "periodic Riccati", "forced response", "simulation",
    "number of modes", "Taylor order",
)  # fmt: skip
DECADES = tuple(10.0**-k for k in range(2, 13))


@dataclass(frozen=True)
class Row:
    """One setting of one method, with its error and its time.

    Attributes
    ----------
    stage : str
        Stage of the work.
    method : str
        Method, or program.
    setting : str
        Its setting, such as order and segments.
    error : float
        Error, relative to the largest entry; of exponents to max(1, |exponent|).
    seconds : float
        Time, in s.
    chosen : str
        Tolerance at which the engine chooses this setting by itself.
    outside : bool
        Whether the method is another program's.
    cheapest : bool
        Whether nothing of flexlin's own in this stage is as accurate in less time.

    Examples
    --------
    >>> from flexlin.answers.accuracy import Row
    >>> Row("exponents", "gauss 8", "16 segments", 1e-9, 0.002).outside
    False
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
    """A table of accuracy against time.

    Attributes
    ----------
    title : str
        Title of the scene.
    rows : tuple of Row
        All settings.
    floor : float
        Below it the reference itself is not known better; not a number where there was no time for two references.
    notes : tuple of str
        What was left out, and why.

    Examples
    --------
    >>> from flexlin.answers.accuracy import CostResult, Row
    >>> fast, exact = Row("exponents", "a", "8", 1e-5, 0.001), Row("exponents", "b", "16", 1e-9, 0.002)
    >>> CostResult("two settings", (fast, exact), 1e-15).cheapest("exponents", 1e-8).method
    'b'
    """

    title: str
    rows: tuple[Row, ...]
    floor: float
    notes: tuple[str, ...] = ()

    __repr__ = represent

    def stage(self, name: str) -> tuple[Row, ...]:
        """Return the rows of one stage.

        Parameters
        ----------
        name : str
            Name of the stage.

        Returns
        -------
        tuple of Row
            Its rows.
        """
        return tuple(row for row in self.rows if row.stage == name)

    def cheapest(self, stage: str, accuracy: float) -> Row | None:
        """Return the fastest of flexlin's own settings that reaches an accuracy.

        Parameters
        ----------
        stage : str
            Name of the stage.
        accuracy : float
            The largest error allowed.

        Returns
        -------
        Row or None
            None when no setting reaches it.
        """
        good = [row for row in self.stage(stage) if not row.outside and row.error <= accuracy]
        return min(good, key=lambda row: row.seconds, default=None)

    def recommendations(self) -> Iterator[tuple[str, float, Row]]:
        """Return the cheapest setting for each decade of accuracy at which it changes.

        Yields
        ------
        tuple
            (stage, accuracy, cheapest row).
        """
        for stage in STAGES:
            last = None
            for accuracy in DECADES:
                row = self.cheapest(stage, accuracy)
                if row is not None and row != last:
                    yield stage, accuracy, row
                last = row

    def marked(self) -> "CostResult":
        """Return the same rows with `cheapest` set on those that no own row beats in both error and time.

        Returns
        -------
        CostResult
            The marked rows.
        """
        rows = tuple(replace(row, cheapest=not row.outside and not self._beaten(row)) for row in self.rows)
        return replace(self, rows=rows)

    def _beaten(self, row: Row) -> bool:
        return any(
            other.seconds < row.seconds and max(other.error, self.floor) <= max(row.error, self.floor)
            for other in self.stage(row.stage)
            if not other.outside
        )

    def record(self) -> dict[str, Any]:
        """Return everything as plain data, for JSON.

        Returns
        -------
        dict
            schema, title, floor, notes and rows.
        """
        rows = [asdict(row) for row in self.rows]
        return {"schema": 1, "title": self.title, "floor": self.floor, "notes": list(self.notes), "rows": rows}
