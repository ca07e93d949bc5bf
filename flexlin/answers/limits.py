"""The limits of time and memory that a stage of the work keeps."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from flexlin.checks import memory_limit
from flexlin.errors import FlexlinError, NumericalError, TimeLimit, TooLarge
from flexlin.errors.root import lacks_memory
from flexlin.resources import read_resident

TICK = 0.2
"""Seconds between two looks at the clock and at the memory in use."""
AGAIN = 1.0
"""Seconds after which the alarm rings once more, where a calculation has taken the first for a failed attempt of its own."""


@dataclass(frozen=True)
class Allowance:
    """What one stage may take: s of wall time, bytes beyond what is held; `whole`, `room`: the s and bytes of all stages together;
    `above`: the least time for all that gives this stage more; `by_tol`: a larger tol makes the stage shorter."""

    seconds: float
    memory: float
    whole: float
    room: float
    above: float
    by_tol: bool = False

    @property
    def more_time(self) -> str:
        """What to do where the time does not do."""
        return (
            f"{self.less}allow more time (--limit-seconds above {self.above:g}, or seconds in the scene's [accuracy])"
        )

    @property
    def more_memory(self) -> str:
        """What to do where the memory does not do."""
        return f"{self.less}allow more (--limit-memory above {self.room:g}, or memory in the scene's [accuracy])"

    @property
    def less(self) -> str:
        """What to ask for instead, where that helps."""
        return "ask for a larger tol, or " if self.by_tol else ""


@contextmanager
def limited(name: str, allowed: Allowance) -> Iterator[None]:
    """Keep the block within the limits of time and memory.

    Raises: TimeLimit, TooLarge; NumericalError in the place of MemoryError, of what CasADi makes of one, and of LinAlgError.
    """
    try:
        with time_limit(name, allowed.seconds, allowed.memory, allowed), memory_limit(allowed.memory):
            yield
    except FlexlinError:
        raise
    except np.linalg.LinAlgError as error:
        todo = "look at the scene's numbers: scales that lie very far apart do this"
        raise NumericalError(f"{name}: linear algebra has no answer", got=str(error), todo=todo) from error
    except (MemoryError, RuntimeError) as error:
        if not lacks_memory(error):
            raise
        got = str(error) if isinstance(error, MemoryError) else None
        raise NumericalError(
            f"{name}: there is not enough memory", got=got or None, todo=f"{allowed.less}ask for less at once"
        ) from error


@contextmanager
def time_limit(
    name: str, seconds: float, memory: float = float("inf"), allowed: Allowance | None = None
) -> Iterator[None]:
    """End the block with TimeLimit once it has taken so many seconds of wall time, with TooLarge once it holds so many bytes more.

    An alarm of the operating system interrupts the main thread between two instructions of Python, as Ctrl-C does; handler and timer of
    before are restored, and so is what NumPy does on overflow: the alarm may ring between a change of that and the block that takes it
    back. In other threads, and where there is no such alarm, the block is let run to its end. `allowed` says what to do.
    """
    allowed = allowed or Allowance(seconds, memory, seconds, memory, seconds)
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    armed, rung, held = True, list[TimeLimit | TooLarge](), read_resident()

    def ring(*_: object) -> None:
        if not armed:
            return
        late, taken = time.perf_counter() - start >= seconds, read_resident() - held
        if late or taken > memory:
            signal.setitimer(signal.ITIMER_REAL, AGAIN, AGAIN)
            rung.append(out_of_time(name, allowed) if late else out_of_memory(name, taken, allowed))
            raise rung[-1]

    start = time.perf_counter()
    handler = signal.signal(signal.SIGALRM, ring)
    before, _ = signal.setitimer(signal.ITIMER_REAL, min(seconds, TICK), min(seconds, TICK))
    try:
        with np.errstate():
            yield
    except BaseException as error:  # compiled code may hand the alarm on as an error of its own
        if rung and not isinstance(error, TimeLimit | TooLarge):
            raise rung[-1] from error
        raise
    finally:
        try:
            armed = False
        finally:  # even if the alarm rings just now
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, handler)
            if before:
                signal.setitimer(signal.ITIMER_REAL, max(1e-3, before - (time.perf_counter() - start)))


def out_of_time(name: str, allowed: Allowance) -> TimeLimit:
    """The error of a stage that took too long."""
    of = f" of the {allowed.whole:g} s of the whole" if allowed.seconds < allowed.whole else ""
    got = f"no answer in {allowed.seconds:.3g} s{of}"
    return TimeLimit(f"{name}: stopped at the time limit", got=got, todo=allowed.more_time)


def out_of_memory(name: str, taken: int, allowed: Allowance) -> TooLarge:
    """The error of a stage that took too much memory."""
    return TooLarge(
        f"{name}: stopped at the limit of memory",
        got=f"{taken} bytes",
        expected=f"at most {allowed.memory:.0f} bytes",
        todo=allowed.more_memory,
    )
