"""Limits of time and memory for the stages of an analysis, with a record of what each was asked, what it reached and what it took."""

import inspect
import logging
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import numpy as np

from flexlin.bounds import printable
from flexlin.checks import memory_limit
from flexlin.errors import FlexlinError, NumericalError, TimeLimit, TooLarge, lacks_memory
from flexlin.resources import LIMIT_SECONDS, Stopwatch, part, read_resident
from flexlin.scene.scene import Accuracy

LOOK_INTERVAL = 0.2
"""Seconds between two looks at the clock and at the memory in use; so the alarm rings once more where a calculation has taken the first
for a failed attempt of its own."""


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
        above = f"--limit-seconds above {self.above:g}, or seconds in the scene's [accuracy]"
        return f"{self.less}allow more time ({above})"

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
        todo = "look at the scene's numbers: a coordinate without inertia, or scales that lie very far apart, do this"
        raise NumericalError(f"{name}: linear algebra has no answer", got=str(error), todo=todo) from error
    except (MemoryError, RuntimeError) as error:
        if not lacks_memory(error):
            raise
        got, todo = str(error) if isinstance(error, MemoryError) else "", f"{allowed.less}ask for less at once"
        raise NumericalError(f"{name}: there is not enough memory", got=got or None, todo=todo) from error


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
        """Raise TimeLimit or TooLarge where the block has taken more than it may."""
        name, allowed, taken = self.name, self.allowed, read_resident() - self.held
        late, waited = self.watch.seconds >= allowed.seconds, self.watch.clock >= allowed.clock
        if late or waited:
            of = f" of the {allowed.whole:g} s of the whole" if allowed.seconds < allowed.whole else ""
            got = f"{allowed.seconds:.3g} s{of}" if late else f"{allowed.clock:.3g} s by the clock"
            todo, what = allowed.more_time, f"{name}: stopped at the time limit"
            self.rung.append(TimeLimit(what, got=f"no answer in {got}", todo=todo))
            raise self.rung[-1]
        if taken > allowed.memory:
            got, most = f"{taken:,} bytes", f"at most {allowed.memory:,.0f} bytes"
            what = f"{name}: stopped at the limit of memory"
            self.rung.append(TooLarge(what, got=got, expected=most, todo=allowed.more_memory))
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
            signal.setitimer(signal.ITIMER_REAL, min(seconds, allowed.clock, LOOK_INTERVAL), LOOK_INTERVAL)
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
                signal.setitimer(signal.ITIMER_REAL, LOOK_INTERVAL, LOOK_INTERVAL)
            else:
                give_back()


STAGE_SHARE = 2 / 3
"""A stage that others follow gets so much of what is left: one that never ends leaves them something."""

DRAWING_SHARE = 0.4
"""Share of the time kept for drawing and writing that drawing may take: the numbers of a large arm or chart take as long."""
PLANNED_SHARE = 0.9
"""Share of its time that a search plans with: a call of a library may take longer than those before it."""


LOG = logging.getLogger(__name__)
Progress = Callable[[str], None]
Answer = TypeVar("Answer")
Measure = Callable[[Any], float] | None
"""The error of an answer, where it has one."""


@dataclass(frozen=True)
class Step:
    """One stage of the work: wall and processor time in s; the error that was asked and the one that was reached, where it has one;
    `problem` says why it has no answer, `notes` what is to be known of it, and what the libraries warned of on the way."""

    name: str
    seconds: float
    cpu_seconds: float = 0.0
    asked: float | None = None
    reached: float | None = None
    problem: str = ""
    notes: tuple[str, ...] = ()

    @property
    def missed(self) -> bool:
        """Whether the answer is less accurate than it was asked to be."""
        return self.asked is not None and self.reached is not None and not self.reached <= self.asked


@dataclass
class Clock:
    """Collects the steps, and the errors of attempts by their names; `progress` is called with the name of each step as it begins.

    asked: the error of each stage, and what all of them together may take; watch: since when;
    planned: how many steps there will be, where that is known: each is said to be one part of the work;
    held: bytes in use before the first stage.
    """

    asked: Accuracy
    progress: Progress | None = None
    planned: int = 0
    watch: Stopwatch = field(default_factory=Stopwatch)
    held: int | None = None
    steps: list[Step] = field(default_factory=list)
    failures: dict[str, FlexlinError] = field(default_factory=dict)

    def allow(
        self, name: str, share: float = 1.0, at_most: float = inf, by_tol: bool = False, last: bool = False
    ) -> Allowance:
        """What a stage gets: a share of what is left, at most some s (more of a long whole); the last one takes what was kept too.

        Raises: TimeLimit where no time is left.
        """
        asked = self.asked
        if self.held is None:
            self.held = read_resident()
        end = asked.last_end if last else asked.stages_end
        left, clock = end - self.watch.seconds, asked.patience * end - self.watch.clock
        most, memory = at_most * max(1.0, asked.seconds / LIMIT_SECONDS), asked.memory + self.held - read_resident()
        above = max(asked.seconds, LIMIT_SECONDS) if most < share * left else asked.seconds
        seconds, waits = min(share * left, most), (1 + share) / 2 * clock
        allowed = Allowance(seconds, max(memory, 1.0), asked.seconds, asked.memory, above, waits, by_tol)
        if min(left, clock) <= 0:
            kept = "" if last else "; the rest is for drawing and writing"
            used = f"{end:g} of {asked.seconds:g} s are used up{kept}"
            raise TimeLimit(f"{name}: not begun", got=used, todo=allowed.more_time)
        return allowed

    def plan(self, share: float = 1.0) -> float:
        """The seconds that a search within a stage plans with, of which no more pass by the clock before the stage is ended."""
        allowed = self.allow("the search", share)
        return PLANNED_SHARE * min(allowed.seconds, allowed.clock)

    @contextmanager
    def step(self, name: str) -> Iterator[dict[str, Any]]:
        """Time the block; what is put into the dictionary becomes part of the step."""
        if self.progress is not None:
            self.progress(name)
        found: dict[str, Any] = {}
        start, cpu = time.perf_counter(), time.process_time()
        low, high = (min((len(self.steps) + k) / (self.planned or 1), 1.0) for k in (0, 1))
        with warnings.catch_warnings(record=True) as heard:
            try:
                with part(low, high) if self.planned else nullcontext():
                    yield found
            except FlexlinError as error:
                found["problem"] = str(error)
                raise
            finally:
                found["notes"] = tuple(dict.fromkeys(map(note_of, heard)))
                step = Step(name, time.perf_counter() - start, time.process_time() - cpu, **found)
                self.steps.append(step)
                LOG.info("%s: %.3f s%s", name, step.seconds, f", {step.problem}" if step.problem else "")

    def note(self, text: str) -> None:
        """Say something more of the last step."""
        self.steps[-1] = replace(self.steps[-1], notes=(*self.steps[-1].notes, text))

    def stage(
        self,
        name: str,
        work: Callable[[], Answer],
        error_of: Measure = None,
        *,
        tol: float | None = None,
        share: float = 1.0,
        at_most: float = inf,
        last: bool = False,
    ) -> Answer:
        """Do the work within the limits; with `error_of` the step says which error was reached, and asked for: `tol`, or that of all.

        Of the time that is left it gets a share, at most some s of 60; the last stage also what was kept for it.

        Raises: what the work raises; TimeLimit, and NumericalError where memory or LAPACK gives out.
        """
        with self.step(name) as found:
            if error_of is not None:
                found["asked"] = tol or self.asked.tol
            allowed = self.allow(name, share, at_most, error_of is not None, last)
            with limited(name, allowed):
                answer = work()
            if error_of is not None:
                found["reached"] = error_of(answer)
        return answer

    def attempt(
        self,
        name: str,
        work: Callable[[], Answer],
        error_of: Measure = None,
        *,
        tol: float | None = None,
        at_most: float = inf,
    ) -> tuple[Answer | None, str]:
        """As `stage`, with time left for what follows: the answer, or why there is none that can be trusted."""
        try:
            return self.stage(name, work, error_of, tol=tol, share=STAGE_SHARE, at_most=at_most), ""
        except FlexlinError as error:  # equations may break at values that a stage tries, and refuse what it computed
            error.__cause__ = error.__context__ = None  # calls that led to it would keep all their arrays in memory
            self.failures[name] = error.with_traceback(None)
            return None, str(error)


def note_of(warning: warnings.WarningMessage) -> str:
    """A warning of a library as one line: its kind, where it came from, what it says."""
    return printable(f"{warning.category.__name__} in {Path(warning.filename).stem}: {warning.message}")
