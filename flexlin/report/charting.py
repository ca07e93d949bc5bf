"""The values of a chart, computed with progress shown; what is done stays when the work is interrupted."""

import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import xarray

from flexlin.answers.clock import Clock
from flexlin.answers.sweep import worst_error
from flexlin.answers.sweep.found import VERDICTS, Found
from flexlin.answers.sweep.job import Job, prepare_job
from flexlin.answers.sweep.run import choose_crew, keep_in
from flexlin.checks import Array
from flexlin.errors import TimeLimit
from flexlin.scene.scene import Scene


def compute_chart(
    scene: Scene,
    values: Callable[[], Mapping[str, Array]],
    clock: Clock,
    show: Callable[[str], None],
    *,
    loop: str = "own",
    workers: int | None = None,
    scheduler: str | None = None,
    store: Path | None = None,
) -> tuple[xarray.Dataset, str]:
    """The sweep over a grid of values, made when the work begins, and why it is not complete, if it is not.

    Raises: as `sweep`; KeyboardInterrupt and TimeLimit only where nothing was computed.
    """
    accuracy, jobs = scene.accuracy, list[Job]()

    def work() -> xarray.Dataset:
        axes = values()
        job = prepare_job(scene, axes, accuracy.tol, grid=len(axes) > 1, loop=loop)
        jobs.append(job)
        if store is not None:
            keep_in(store, job)
        job.watchers.append(Counting(len(job.points), int(job.done.sum()), show))
        job.run(choose_crew(job, workers, scheduler))
        return job.dataset()

    try:
        return clock.stage("exponents of all values", accuracy, work, worst_error), ""
    except (KeyboardInterrupt, TimeLimit) as error:
        if not jobs or not jobs[0].done.any():
            raise
        return jobs[0].dataset(), say_what_is_missing(jobs[0], error, store)


def say_what_is_missing(job: Job, error: BaseException, store: Path | None) -> str:
    """Why a chart is not complete, and what to do."""
    why = "interrupted" if isinstance(error, KeyboardInterrupt) else str(error)
    todo = "with --store CHART.zarr it could go on" if store is None else "the same command goes on from here"
    return f"{why}: {int(job.done.sum()):,} of {len(job.points):,} values are in the chart; {todo}"


LONG = 60.0
"""Seconds of work that are announced when it begins."""
SOON = 0.5
"""Seconds after which the whole time is estimated."""


class Counting:
    """Counts finished values, each block by a call; `show` takes the line."""

    def __init__(self, values: int, done: int, show: Callable[[str], None]):
        self._values, self._first, self._show = values, done, show
        self._counts = np.zeros(len(VERDICTS), dtype=int)
        self._start, self._announced = time.monotonic(), False
        if done:
            announce(f"{done:,} of {values:,} values are there already")

    def __call__(self, start: int, block: Found) -> None:
        """Count a block, and show what is known."""
        self._counts += np.bincount(block.verdict, minlength=len(VERDICTS))
        elapsed, done = time.monotonic() - self._start, int(self._counts.sum())
        counts = ", ".join(f"{n:,} {word}" for n, word in zip(self._counts, VERDICTS, strict=True) if n)
        self._show(f"exponents of all values, {done / max(elapsed, 1e-9):,.0f} a second: {counts}")
        if not self._announced and elapsed > SOON:
            self._announced = True
            whole = elapsed * (self._values - self._first) / done
            if whole > LONG:
                announce(f"{self._values - self._first:,} values will take about {whole / 60:.0f} min")


def announce(line: str) -> None:
    """One line on stderr."""
    print(f"flexlin: {line}", file=sys.stderr, flush=True)
