"""The stages of the work: what each was asked, what it reached, what it took, and the limits that each and all keep."""

import logging
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any, TypeVar

from flexlin.answers.limits import Allowance, limited
from flexlin.bounds import printable
from flexlin.errors import FlexlinError, NumericalError, TimeLimit, TooLarge
from flexlin.progress import part
from flexlin.resources import SECONDS, Stopwatch, read_resident
from flexlin.scene.scene import Accuracy

SHARE = 2 / 3
"""A stage that others follow gets so much of what is left: one that never ends leaves them something."""

DRAWING = 0.4
"""Share of the time kept for drawing and writing that drawing may take: the numbers of a large arm or chart take as long."""
USED = 0.9
"""Share of its time that a search plans with: a call of a library may take longer than those before it."""


@dataclass
class Budget:
    """Time and memory of one piece of work; `held`: bytes in use before its first stage."""

    watch: Stopwatch = field(default_factory=Stopwatch)
    held: int | None = None

    def allow(
        self, name: str, asked: Accuracy, share: float = 1.0, at_most: float = inf, by_tol: bool = False, last: bool = False
    ) -> Allowance:  # fmt: skip
        """What a stage gets: a share of what is left, at most some s (more of a long whole); the last one takes what was kept too.

        Raises: TimeLimit where no time is left.
        """
        if self.held is None:
            self.held = read_resident()
        end = asked.last_end if last else asked.stages_end
        left, clock = end - self.watch.seconds, asked.patience * end - self.watch.clock
        most, memory = at_most * max(1.0, asked.seconds / SECONDS), asked.memory + self.held - read_resident()
        above = max(asked.seconds, SECONDS) if most < share * left else asked.seconds
        seconds, waits = min(share * left, most), (1 + share) / 2 * clock
        allowed = Allowance(seconds, max(memory, 1.0), asked.seconds, asked.memory, above, waits, by_tol)
        if min(left, clock) <= 0:
            kept = "" if last else "; the rest is for drawing and writing"
            used = f"{end:g} of {asked.seconds:g} s are used up{kept}"
            raise TimeLimit(f"{name}: not begun", got=used, todo=allowed.more_time)
        return allowed

    def plan(self, name: str, asked: Accuracy, share: float = 1.0) -> float:
        """The seconds that a search within a stage plans with, of which no more pass by the clock before the stage is ended."""
        allowed = self.allow(name, asked, share)
        return USED * min(allowed.seconds, allowed.clock)


LOG = logging.getLogger(__name__)
Progress = Callable[[str], None]
Answer = TypeVar("Answer")


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
    """Collects the steps, and the errors of attempts by their keys; `progress` is called with the name of each step as it begins.

    budget: what all stages together may take;
    planned: how many steps there will be, where that is known: each is said to be one part of the work.
    """

    progress: Progress | None = None
    steps: list[Step] = field(default_factory=list)
    failures: dict[str, FlexlinError] = field(default_factory=dict)
    planned: int = 0
    budget: Budget = field(default_factory=Budget)

    @contextmanager
    def step(self, name: str) -> Iterator[dict[str, Any]]:
        """Time the block; what is put into the dictionary becomes part of the step."""
        if self.progress is not None:
            self.progress(name)
        found: dict[str, Any] = {}
        start, cpu, heard = time.perf_counter(), time.process_time(), list[warnings.WarningMessage]()
        try:
            with warnings.catch_warnings(record=True) as recorded, self._part():
                heard = recorded
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

    def _part(self) -> AbstractContextManager[None]:
        """The part of the work that the next step is, where it is known how many there will be."""
        if not self.planned:
            return nullcontext()
        low, high = (min(done / self.planned, 1.0) for done in (len(self.steps), len(self.steps) + 1))
        return part(low, high)

    def stage(
        self,
        name: str,
        accuracy: Accuracy,
        work: Callable[[], Answer],
        error_of: Callable[[Answer], float] | None = None,
        *,
        share: float = 1.0,
        at_most: float = inf,
        last: bool = False,
    ) -> Answer:
        """Do the work within the limits; with `error_of` the step says which error was asked for and reached.

        Of the time that is left it gets a share, at most some s of 60; the last stage also what was kept for it.

        Raises: what the work raises; TimeLimit, and NumericalError where memory or LAPACK gives out.
        """
        with self.step(name) as found:
            if error_of is not None:
                found["asked"] = accuracy.tol
            allowed = self.budget.allow(name, accuracy, share, at_most, error_of is not None, last)
            with limited(name, allowed):
                answer = work()
            if error_of is not None:
                found["reached"] = error_of(answer)
        return answer

    def attempt(
        self,
        problems: dict[str, str],
        key: str,
        name: str,
        accuracy: Accuracy,
        work: Callable[[], Answer],
        error_of: Callable[[Answer], float] | None = None,
        *,
        at_most: float = inf,
    ) -> Answer | None:
        """As `stage`, with time left for what follows; where there is no trustworthy answer, note why under `key` and return nothing."""
        try:
            return self.stage(name, accuracy, work, error_of, share=SHARE, at_most=at_most)
        except (NumericalError, TooLarge) as error:
            problems[key], self.failures[key] = str(error), forget_trace(error)
            return None


def forget_trace(error: FlexlinError) -> FlexlinError:
    """The error without the calls that led to it, which would keep all their arrays in memory."""
    error.__cause__ = error.__context__ = None
    return error.with_traceback(None)


def note_of(warning: warnings.WarningMessage) -> str:
    """A warning of a library as one line: its kind, where it came from, what it says."""
    return printable(f"{warning.category.__name__} in {Path(warning.filename).stem}: {warning.message}")
