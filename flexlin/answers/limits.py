"""The limits of time and memory that a stage of the work keeps."""

import inspect
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType

import numpy as np

from flexlin.checks import memory_limit
from flexlin.errors import FlexlinError, NumericalError, TimeLimit, TooLarge, lacks_memory
from flexlin.resources import Stopwatch, read_resident

TICK = 0.2
"""Seconds between two looks at the clock and at the memory in use."""
AGAIN = 0.3
"""Seconds after which the alarm rings once more, where a calculation has taken the first for a failed attempt of its own."""


@dataclass(frozen=True)
class Allowance:
    """What one stage may take: s of work, bytes beyond what is held; `whole`, `room`: the s and bytes of all stages together; `above`: the
    least time for all that gives this stage more; `clock`: s of the clock; `by_tol`: a larger tol makes the stage shorter."""

    seconds: float
    memory: float
    whole: float
    room: float
    above: float
    clock: float
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


def count_imports(frame: FrameType | None) -> int:
    """How many imports are under way in a frame: an alarm amid one would leave half a module, taken for a whole one later."""
    count = 0
    while frame is not None:
        code, frame = frame.f_code, frame.f_back
        count += code.co_name == "_find_and_load" and code.co_filename.startswith("<frozen importlib")
    return count


@dataclass(frozen=True, eq=False)
class Limit:
    """The limit of a block: a watch that began with it, what was held and imported then, and the alarms that rang for it."""

    name: str
    allowed: Allowance
    watch: Stopwatch = field(default_factory=Stopwatch)
    held: int = field(default_factory=read_resident)
    imports: int = field(default_factory=lambda: count_imports(inspect.currentframe()))
    rung: list[TimeLimit | TooLarge] = field(default_factory=list)

    def look(self) -> None:
        """Raise TimeLimit or TooLarge where the block has taken more than it may; ring again, in case that is lost."""
        name, allowed, taken = self.name, self.allowed, read_resident() - self.held
        late, waited = self.watch.seconds >= allowed.seconds, self.watch.clock >= allowed.clock
        if late or waited or taken > allowed.memory:
            signal.setitimer(signal.ITIMER_REAL, AGAIN, AGAIN)
            over = late or waited
            self.rung.append(out_of_time(name, allowed, not late) if over else out_of_memory(name, taken, allowed))
            raise self.rung[-1]


WATCHED: list[Limit] = []
"""The limits of the blocks that the main thread is in, the outermost first."""
LOOKING = threading.Lock()
"""Held while they are looked at: on a busy machine the next alarm may ring before that has ended."""


def look_at_all(_: int, frame: FrameType | None) -> None:
    """Look whether the work is within all of its limits, which is what the alarm is for; behind an import, where one is under way."""
    if LOOKING.acquire(blocking=False):
        try:
            for limit in tuple(WATCHED):
                if count_imports(frame) <= limit.imports:
                    limit.look()
        finally:
            LOOKING.release()


def take_alarm() -> Callable[[], None]:
    """Have the alarm look at the limits; what it raises in a finalizer or a callback of the garbage collector, where Python drops and
    prints it, is not printed. Gives what restores handler, hook and timer of before."""
    watch, report = Stopwatch(), sys.unraisablehook

    def pass_over(dropped: "sys.UnraisableHookArgs") -> None:
        if not any(dropped.exc_value is alarm for limit in WATCHED for alarm in limit.rung):
            report(dropped)

    def give_back() -> None:
        signal.signal(signal.SIGALRM, handler)
        if sys.unraisablehook is pass_over:
            sys.unraisablehook = report
        if left:
            signal.setitimer(signal.ITIMER_REAL, max(1e-3, left - watch.clock), interval)

    left, interval = signal.setitimer(signal.ITIMER_REAL, 0)
    sys.unraisablehook, handler = pass_over, signal.signal(signal.SIGALRM, look_at_all)
    return give_back


@contextmanager
def time_limit(
    name: str, seconds: float, memory: float = float("inf"), allowed: Allowance | None = None
) -> Iterator[None]:
    """End the block with TimeLimit after so many seconds of the clock, or as `allowed` has it; with TooLarge beyond so many bytes more.

    An alarm of the operating system interrupts the main thread between two instructions of Python, as Ctrl-C does, at the limit of this
    block or of one around it; handler, hook and timer of before are restored, and so is what NumPy does on overflow: the alarm may ring
    between a change of that and the block that takes it back. In other threads, and where there is no such alarm, the block is let run to
    its end.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    allowed = allowed or Allowance(seconds, memory, seconds, memory, seconds, seconds)
    limit, depth = Limit(name, allowed), len(WATCHED)
    give_back = None if depth else take_alarm()
    try:
        with np.errstate():
            WATCHED.append(limit)
            signal.setitimer(signal.ITIMER_REAL, min(seconds, allowed.clock, TICK), TICK)
            yield
    except BaseException as error:  # compiled code may hand the alarm on as an error of its own
        if limit.rung and not isinstance(error, TimeLimit | TooLarge):
            raise limit.rung[-1] from error
        raise
    finally:
        try:
            signal.setitimer(signal.ITIMER_REAL, 0)
        finally:  # even if the alarm rings just now
            del WATCHED[depth:]
            if give_back is None:
                signal.setitimer(signal.ITIMER_REAL, TICK, TICK)
            else:
                give_back()


def out_of_time(name: str, allowed: Allowance, by_clock: bool) -> TimeLimit:
    """The error of a stage that took too long."""
    taken = allowed.clock if by_clock else allowed.seconds
    of = f" of the {allowed.whole:g} s of the whole" if allowed.seconds < allowed.whole else ""
    got = f"no answer in {taken:.3g} s{' by the clock' if by_clock else of}"
    return TimeLimit(f"{name}: stopped at the time limit", got=got, todo=allowed.more_time)


def out_of_memory(name: str, taken: int, allowed: Allowance) -> TooLarge:
    """The error of a stage that took too much memory."""
    return TooLarge(
        f"{name}: stopped at the limit of memory",
        got=f"{taken:,} bytes",
        expected=f"at most {allowed.memory:,.0f} bytes",
        todo=allowed.more_memory,
    )
