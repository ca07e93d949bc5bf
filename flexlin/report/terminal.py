"""What the command line prints: short, and in colour only on a terminal."""

import sys
import threading
from typing import Any

from flexlin.report.advice import next_steps
from flexlin.report.analysis import Analysis, Loop
from flexlin.report.wording import pace, rate

COLOURS = {"stable": "green", "unstable": "red", "undecided": "yellow", "failed": "red"}
PATIENCE = 1.0
"""Seconds of silence before progress is shown."""


def say(text: str = "", verdict: str | None = None) -> None:
    """Print a line; a verdict at its beginning is coloured on a terminal."""
    if verdict is None or not sys.stdout.isatty():
        print(text)
        return
    from rich.console import Console
    from rich.text import Text

    line = Text(text)
    line.highlight_words([verdict], COLOURS[verdict] + " bold")
    Console(highlight=False, soft_wrap=True).print(line)


def summarize(analysis: Analysis) -> None:
    """Print the verdicts and what to do next."""
    say(analysis.scene.title)
    for loop in analysis.loops:
        say(loop_line(loop, analysis.plant.period), loop.verdict)
    for step in next_steps(analysis):
        say(f"- {step}")


def loop_line(loop: Loop, period: float) -> str:
    """One loop in one line."""
    told = pace(loop, period)
    return f"  {loop.name:<18} {loop.verdict:<10} {told}" + (
        f", {rate(*loop.growth)}" if loop.floquet is not None else ""
    )


class Progress:
    """Shows the step at hand on a terminal once the work has taken longer than a second; says nothing elsewhere.

    Use as a context manager, and call it with the name of each step.
    """

    def __init__(self) -> None:
        self._name = ""
        self._status: Any = None
        self._lock = threading.Lock()
        self._timer = threading.Timer(PATIENCE, self._show)
        self._timer.daemon = True

    def __call__(self, name: str) -> None:
        with self._lock:
            self._name = name
            if self._status is not None:
                self._status.update(name)

    def __enter__(self) -> "Progress":
        if sys.stderr.isatty():
            self._timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        with self._lock:
            if self._status is not None:
                self._status.stop()
            self._status = None
            self._name = ""

    def _show(self) -> None:
        from rich.console import Console

        with self._lock:
            if self._name:
                self._status = Console(stderr=True).status(self._name)
                self._status.start()
