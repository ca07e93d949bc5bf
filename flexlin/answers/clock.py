"""The stages of the work: what each was asked, what it reached, what it took, and the limits that it keeps."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from flexlin.checks import memory_limit
from flexlin.errors import FlexlinError, NumericalError, TimeLimit, TooLarge
from flexlin.scene.accuracy import Accuracy

Progress = Callable[[str], None]
Answer = TypeVar("Answer")
AGAIN = 1.0
"""Seconds after which the alarm rings once more, where a calculation has taken the first for a failed attempt of its own."""


@dataclass(frozen=True)
class Step:
    """One stage of the work: wall and processor time in s; the error that was asked and the one that was reached, where it has one;
    `problem` says why it has no answer."""

    name: str
    seconds: float
    cpu_seconds: float = 0.0
    asked: float | None = None
    reached: float | None = None
    problem: str = ""

    @property
    def missed(self) -> bool:
        """Whether the answer is less accurate than it was asked to be."""
        return self.asked is not None and self.reached is not None and not self.reached <= self.asked


@dataclass
class Clock:
    """Collects the steps, and the errors of attempts by their keys; `progress` is called with the name of each step as it begins."""

    progress: Progress | None = None
    steps: list[Step] = field(default_factory=list)
    failures: dict[str, FlexlinError] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[dict[str, Any]]:
        """Time the block; what is put into the dictionary becomes part of the step."""
        if self.progress is not None:
            self.progress(name)
        found: dict[str, Any] = {}
        start, cpu = time.perf_counter(), time.process_time()
        try:
            yield found
        except FlexlinError as error:
            found["problem"] = str(error)
            raise
        finally:
            self.steps.append(Step(name, time.perf_counter() - start, time.process_time() - cpu, **found))

    def stage(
        self,
        name: str,
        accuracy: Accuracy,
        work: Callable[[], Answer],
        error_of: Callable[[Answer], float] | None = None,
    ) -> Answer:
        """Do the work within the limits; with `error_of` the step says which error was asked for and reached.

        Raises: what the work raises; TimeLimit, and NumericalError where memory or LAPACK gives out.
        """
        with self.step(name) as found:
            if error_of is not None:
                found["asked"] = accuracy.tol
            with limited(name, accuracy):
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
    ) -> Answer | None:
        """As `stage`; where there is no trustworthy answer, note why under `key` and return nothing."""
        try:
            return self.stage(name, accuracy, work, error_of)
        except (NumericalError, TooLarge) as error:
            problems[key], self.failures[key] = str(error), error
            return None


@contextmanager
def limited(name: str, accuracy: Accuracy) -> Iterator[None]:
    """Keep the block within the limits of time and memory.

    Raises: TimeLimit, TooLarge; NumericalError in the place of MemoryError and LinAlgError.
    """
    try:
        with time_limit(name, accuracy.seconds), memory_limit(accuracy.memory):
            yield
    except FlexlinError:
        raise
    except MemoryError as error:
        todo = "ask for a larger tol, or for less at once"
        raise NumericalError(f"{name}: there is not enough memory", got=str(error) or None, todo=todo) from error
    except np.linalg.LinAlgError as error:
        todo = "look at the scene's numbers: scales that lie very far apart do this"
        raise NumericalError(f"{name}: linear algebra has no answer", got=str(error), todo=todo) from error


@contextmanager
def time_limit(name: str, seconds: float) -> Iterator[None]:
    """End the block with TimeLimit once it has taken so many seconds of wall time.

    An alarm of the operating system interrupts the main thread between two instructions of Python, as Ctrl-C does; handler and timer of
    before are restored. In other threads, and where there is no such alarm, the block is let run to its end.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return
    armed, rung = True, False

    def ring(*_: object) -> None:
        nonlocal rung
        if armed:
            rung = True
            raise out_of_time(name, seconds)

    handler, start = signal.signal(signal.SIGALRM, ring), time.perf_counter()
    before, _ = signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield
    except BaseException as error:  # compiled code may hand the alarm on as an error of its own
        if rung and not isinstance(error, TimeLimit):
            raise out_of_time(name, seconds) from error
        raise
    finally:
        try:
            armed = False
        finally:  # even if the alarm rings just now
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, handler)
            if before:
                signal.setitimer(signal.ITIMER_REAL, max(1e-3, before - (time.perf_counter() - start)))


def out_of_time(name: str, seconds: float) -> TimeLimit:
    """The error of a stage that was stopped."""
    return TimeLimit(
        f"{name}: stopped at the time limit",
        got=f"no answer in {seconds:g} s",
        todo="ask for a larger tol, or allow more time (--limit-seconds, or seconds in the scene's [accuracy])",
    )
