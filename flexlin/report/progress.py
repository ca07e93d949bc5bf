"""Progress on stderr, once the work has taken two seconds: on a terminal one line that changes, in a pipe a line now and then."""

import math
import sys
import threading
import time
from typing import Any

from flexlin.progress import listening

PATIENCE = 2.0
"""Seconds of silence before progress is shown."""
TICK, APART, REPEATED = 0.25, 5.0, 60.0
"""Seconds between two looks at the clock, between two lines in a pipe, and between two of the same step and share."""
LEAST = 0.02
"""No time left is guessed before this share is done."""
SLIP = 1.5
"""A guess of the time left that has grown by this factor over the least one is not shown."""


class Progress:
    """Shows the step at hand, how much is done and how long the rest may take, once the work has taken longer than two seconds.

    Use as a context manager, which listens to what calculations say of themselves, and call it with the name of each step.
    """

    def __init__(self) -> None:
        self._name, self.share, self._left = "", 0.0, math.inf
        self._status: Any = None
        self._over = threading.Event()
        self._listening = listening(self._advance)
        self._start, self._written, self._said = time.perf_counter(), 0.0, ("", 0.0)
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __call__(self, name: str) -> None:
        self._name = str(name)

    def _advance(self, share: float) -> None:
        """Take a share; what was done once stays done."""
        self.share = max(self.share, min(share, 1.0))

    @property
    def line(self) -> str:
        """What is shown; a time left that was too short is not taken back, but no longer shown."""
        share, elapsed = self.share, time.perf_counter() - self._start
        if share < LEAST:
            return f"{self._name} ({elapsed:.0f} s so far)"
        left = elapsed * (1 - share) / share
        if left > SLIP * self._left + TICK:
            return f"{100 * share:.0f} %, {elapsed:.0f} s so far: {self._name}"
        self._left = min(left, self._left)
        return f"{100 * share:.0f} %, about {self._left:.0f} s left: {self._name}"

    def __enter__(self) -> "Progress":
        self._start = time.perf_counter()
        self._listening.__enter__()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.__exit__(None, None, None)
        self._over.set()
        self._thread.join()
        if self._status is not None:
            self._status.stop()
        self._status = None

    def _watch(self) -> None:
        """Show the line from time to time, until the work is over."""
        stderr = sys.__stderr__
        if self._over.wait(PATIENCE) or stderr is None or sys.stderr is not stderr:
            return  # over already, or a program has put a stream of its own there and reads errors from it
        show = self._on_terminal if stderr.isatty() else self._in_pipe
        while not self._over.is_set():
            if self._name:
                show()
            self._over.wait(TICK)

    def _on_terminal(self) -> None:
        if self._status is None:
            from rich.console import Console

            self._status = Console(stderr=True).status(self.line)
            self._status.start()
        self._status.update(self.line)

    def _in_pipe(self) -> None:
        now, saying = time.perf_counter(), (self._name, self.share)
        if now - self._written >= (REPEATED if saying == self._said else APART):
            self._written, self._said = now, saying
            print(f"flexlin: {self.line}", file=sys.stderr, flush=True)
