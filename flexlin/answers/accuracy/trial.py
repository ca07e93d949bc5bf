"""One setting tried: what came out, how far off it is, how long it took."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np

from flexlin.answers.accuracy.result import Row
from flexlin.answers.limits import time_limit
from flexlin.checks import Array
from flexlin.errors import FlexlinError
from flexlin.progress import advance

SHORT, REPETITIONS = 0.05, 5
"""Runs shorter than this, in s, are repeated so often and their median is kept."""
STAGE_SECONDS = 5.0
"""Wall time of the trials of a stage."""


@dataclass(frozen=True)
class Trial:
    """A method at one setting, ready to run; `detail` says of what came out what belongs to the setting."""

    method: str
    setting: str
    run: Callable[[], Any]
    chosen: str = ""
    outside: bool = False
    detail: Callable[[Any], str] | None = None


def measure_trials(stage: str, trials: Iterable[Trial], error: Callable[[Any], float]) -> list[Row]:
    """Run the trials one after another for STAGE_SECONDS, the first ones first.

    One that gives up (too many segments, no time left, an outside integrator's failure) or overflows has no row.
    """
    rows, end = [], perf_counter() + STAGE_SECONDS
    for trial in trials:
        left = end - perf_counter()
        advance(1 - left / STAGE_SECONDS)
        if left <= 0:
            break
        try:
            with time_limit(stage, left):
                value, seconds = time_run(trial.run)
        except (FlexlinError, RuntimeError):
            continue
        missed = error(value)
        if not np.isfinite(missed):
            continue
        setting = ", ".join([trial.setting, *([trial.detail(value)] if trial.detail else [])])
        rows.append(Row(stage, trial.method, setting, missed, seconds, trial.chosen, trial.outside))
    return rows


def time_run(run: Callable[[], Any]) -> tuple[Any, float]:
    """The result and the CPU time: the first run warms up, the median of the next counts; of long runs the first."""
    start = process_time()
    value = run()
    first = process_time() - start
    if first > SHORT:
        return value, first
    times = []
    for _ in range(REPETITIONS):
        start = process_time()
        run()
        times.append(process_time() - start)
    return value, max(median(times), 1e-9)


def compare_arrays(value: Array, exact: Array) -> float:
    """Largest difference relative to the largest entry; inf or not a number where the value is no number."""
    with np.errstate(invalid="ignore", over="ignore"):
        return float(np.abs(value - exact).max() / max(float(np.abs(exact).max()), float(np.finfo(float).tiny)))


def compare_exponents(value: Array, exact: Array) -> float:
    """Largest distance to the nearest exact exponent, relative to max(1, |exponent|)."""
    return float((np.abs(value[:, None] - exact).min(axis=0) / np.maximum(1.0, np.abs(exact))).max())
