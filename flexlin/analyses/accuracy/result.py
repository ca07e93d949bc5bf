"""The table of accuracy against time, and the trials of settings that fill it."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from time import perf_counter, process_time
from timeit import repeat
from typing import Any

import numpy as np

from flexlin.analyses.clock import time_limit
from flexlin.checks import Array
from flexlin.errors import FlexlinError
from flexlin.periodic.circle import measure_distances
from flexlin.resources import advance
from flexlin.summary import immutable

STAGES = (
    "coefficients", "transition matrices", "exponents", "periodic Riccati", "forced response", "simulation",
    "number of modes", "Taylor order",
)  # fmt: skip
STAGE_SECONDS = 5.0
"""Wall time of the trials of a stage, where the whole has enough."""


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

    Examples
    --------
    >>> from flexlin.analyses.accuracy import Row
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


@immutable
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
    >>> from flexlin.analyses.accuracy import CostResult, Row
    >>> fast, exact = Row("exponents", "a", "8", 1e-5, 0.001), Row("exponents", "b", "16", 1e-9, 0.002)
    >>> CostResult("two settings", (fast, exact), 1e-15).cheapest("exponents", 1e-8).method
    'b'
    """

    title: str
    rows: tuple[Row, ...]
    floor: float
    notes: tuple[str, ...] = ()

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
            for accuracy in (10.0**-k for k in range(2, 13)):
                row = self.cheapest(stage, accuracy)
                if row is not None and row != last:
                    yield stage, accuracy, row
                last = row

    def record(self) -> dict[str, Any]:
        """Return everything as plain data, for JSON.

        Returns
        -------
        dict
            schema, title, floor, notes and rows.
        """
        rows = [asdict(row) for row in self.rows]
        return {"schema": 1, "title": self.title, "floor": self.floor, "notes": list(self.notes), "rows": rows}


@dataclass(frozen=True, eq=False)
class Trial:
    """A method at one setting, ready to run; `detail` says of what came out what belongs to the setting."""

    method: str
    setting: str
    run: Callable[[], Any]
    chosen: str = ""
    outside: bool = False
    detail: Callable[[Any], str] | None = None


Trials = tuple[Iterable[Trial], Callable[[Any], float]]
"""What a stage tries, and the error of what comes out."""


def measure_stage(name: str, stage: Callable[[], Trials], most: float) -> tuple[list[Row], list[str]]:
    """The rows of a stage that may take some s and begins with its references; a note where it has none, or not all."""
    begin, seconds = perf_counter(), max(min(STAGE_SECONDS, most), 1e-3)
    try:
        with time_limit(name, max(min(2 * seconds, most), 1e-3)):
            rows = measure_trials(name, *stage(), seconds)
    except FlexlinError as error:
        return [], [f"{name} left out: {error.what}"]
    over = f"{name}: the slowest settings are left out, which {seconds:.2g} s do not hold"
    return rows, [over] if perf_counter() - begin > seconds else []


def measure_trials(
    stage: str, trials: Iterable[Trial], error: Callable[[Any], float], seconds: float = STAGE_SECONDS
) -> list[Row]:
    """Run the trials one after another for some seconds.

    One that gives up (too many segments, no time left, an outside integrator's failure) or overflows has no row.
    """
    rows, begin = list[Row](), perf_counter()
    for trial in trials:
        left = begin + seconds - perf_counter()
        advance(1 - left / seconds)
        if left <= 0:
            break
        try:
            with time_limit(stage, left):
                value, taken = time_run(trial.run)
        except (FlexlinError, RuntimeError):
            continue
        missed = error(value)
        if np.isfinite(missed):
            setting = ", ".join([trial.setting, *([trial.detail(value)] if trial.detail else [])])
            rows.append(Row(stage, trial.method, setting, missed, taken, trial.chosen, trial.outside))
    return rows


def time_run(run: Callable[[], Any]) -> tuple[Any, float]:
    """The result and the CPU time: the first run warms up, the least of five more counts; of one beyond 0.05 s the first."""
    start = process_time()
    value = run()
    first = process_time() - start
    if first > 0.05:
        return value, first
    return value, max(min(repeat(run, timer=process_time, number=1)), 1e-9)


def compare_arrays(value: Array, exact: Array) -> float:
    """Largest difference relative to the largest entry; inf or not a number where the value is no number."""
    with np.errstate(invalid="ignore", over="ignore"):
        return float(np.abs(value - exact).max() / max(float(np.abs(exact).max()), float(np.finfo(float).tiny)))


def compare_exponents(value: Array, exact: Array, period: float) -> float:
    """Largest distance of an exact exponent to the nearest one, modulo 2 pi i / T, relative to max(1, |exponent|)."""
    apart = measure_distances(value * period, exact * period).min(axis=0) / period
    return float((apart / np.maximum(1.0, np.abs(exact))).max())
