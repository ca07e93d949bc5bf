"""How fast many values are computed, and the verdicts so far: what a progress line says beside share and time left."""

import sys
import time
from collections.abc import Callable

import numpy as np

from flexlin.answers.sweep.found import VERDICTS, Found

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
