"""Progress on a terminal, once the work has taken longer than a second."""

import sys
import threading
from typing import Any

PATIENCE = 1.0
"""Seconds of silence before progress is shown."""


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
