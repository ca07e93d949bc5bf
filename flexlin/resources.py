"""What a run may take where nobody says otherwise, what it has taken, and how much of it is done. No library is loaded.

A calculation says its share wherever it knows, and whoever listens shows it; without a listener that is a look at one variable.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar

from flexlin.context import holding

LIMIT_SECONDS, LIMIT_BYTES = 60.0, 7e8
"""The usual limits: time of the processor in s, and memory beside the libraries."""
CLOCK_RATIO = 3.0
"""Seconds of the clock for each of the processor, where other programs use it too."""


class Stopwatch:
    """Seconds of work since a time by `perf_counter`, by default now: of the processor, or of the clock where several work at once."""

    def __init__(self, begun: float | None = None):
        self.begun, self.worked = time.perf_counter() if begun is None else begun, read_processor()

    @property
    def clock(self) -> float:
        """Seconds of the clock."""
        return time.perf_counter() - self.begun

    @property
    def seconds(self) -> float:
        """Seconds of work."""
        return min(self.clock, read_processor() - self.worked)


def read_processor() -> float:
    """Seconds of processor time of this process and its children, those at work too where the system names them."""
    spent = sum(os.times()[:4])
    with suppress(OSError):
        for thread in os.listdir("/proc/self/task"):
            with suppress(OSError, ValueError, IndexError):  # a thread or a child that has just ended
                for child in _read(f"/proc/self/task/{thread}/children").split():
                    user, system = _read(f"/proc/{child}/stat").rpartition(")")[2].split()[11:13]
                    spent += (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")
    return spent


def read_resident(process: int | str = "self") -> int:
    """Bytes of memory that a process holds; 0 where the system does not say."""
    try:
        return int(_read(f"/proc/{process}/statm").split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def _read(path: str) -> str:
    """A short file of the system. An alarm may end the reading anywhere: of a file object that is not closed then, Python would warn."""
    file = os.open(path, os.O_RDONLY)
    try:
        return os.read(file, 2**16).decode()
    finally:
        os.close(file)


Listener = Callable[[float], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


def advance(share: float) -> None:
    """Say that this share, from 0 to 1, of the work at hand is done."""
    listener = _listener.get()
    if listener is not None:
        listener(share)


def listening(listener: Listener) -> AbstractContextManager[None]:
    """Hand every share that the block says to a listener."""
    return holding(_listener, listener)


@contextmanager
def part(low: float, high: float) -> Iterator[None]:
    """The block is the part from `low` to `high` of the work outside: what it says from 0 to 1 is said of the whole."""
    outside = _listener.get()
    if outside is None:
        yield
        return
    outside(low)
    with listening(lambda share: outside(low + (high - low) * min(max(share, 0.0), 1.0))):
        yield
    outside(high)
