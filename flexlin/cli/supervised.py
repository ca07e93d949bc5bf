"""The work in a process of its own, watched by its parent: whatever becomes of it, there is a message, and it ends within its limits.

Python ends a stage between two instructions. It cannot end a single call of a compiled library, and a library that finds no memory may end
the process without a word. The parent took its own memory before the work began.
"""

import atexit
import contextlib
import math
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flexlin.cli.shared import BAD_INPUT, FAILED
from flexlin.resources import BYTES, SECONDS, read_resident

if TYPE_CHECKING:
    from flexlin.scene.accuracy import Accuracy

TICK = 0.1
"""Seconds between two looks at the memory of the work."""
ENDING = 1.5
"""Seconds that Python takes to begin, and a process that is ended to give its memory back."""
LIBRARIES, BEYOND = 2e8, 1.2
"""Bytes that the libraries take; what the work may hold for a moment, in its limit: it ends itself at the limit, if it can."""
LEAST_SPACE = 2.5e8
"""Address space in bytes below which the libraries cannot be loaded; one of them then tries for ever."""
PASSED_ON = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED = "interrupted; no file was left half-written"
NO_MEMORY = "there is not enough memory; ask for less at once"


class Channel:
    """How the work lets its parent know its limits, and that all has been said."""

    writer: int | None = None

    @classmethod
    def send(cls, *words: float | str) -> None:
        """Send one line."""
        if cls.writer is not None:
            with contextlib.suppress(OSError):
                os.write(cls.writer, (" ".join(map(str, words)) + "\n").encode())


def send_limits(begun: float, asked: "Accuracy") -> None:
    """Let the parent know what a scene's run may take; `begun` by `time.perf_counter`, which all processes share."""
    end = asked.last_end - min(ENDING, 0.05 * asked.seconds)
    Channel.send("limits", begun + end, asked.seconds, asked.memory)


def supervise(work: Callable[[], int]) -> int:
    """Do the work, which prints its own messages, and return its exit code; on Linux in a process of its own.

    Where that process is ended by something else, or goes on beyond its limits, its parent says so.
    """
    if sys.platform != "linux" or threading.active_count() > 1:
        return work()
    if (space := read_space()) < LEAST_SPACE:
        print(
            f"flexlin: {NO_MEMORY}; got {space / 1e6:.0f} MB of address space, expected {LEAST_SPACE / 1e6:.0f} MB: raise ulimit -v",
            file=sys.stderr,
        )
        return BAD_INPUT
    parent, (reader, writer) = os.getpid(), os.pipe()
    watch = Watch(reader)
    handlers = {number: signal.signal(number, watch.pass_on) for number in PASSED_ON}
    try:
        watch.child = os.fork()
    except OSError:  # no room for a second process
        watch.child = -1
    if watch.child > 0:
        os.close(writer)
        os._exit(watch.wait())  # what follows, the work's process does
    for number, handler in handlers.items():
        signal.signal(number, handler)
    if watch.child < 0:
        return work()
    os.close(reader)
    Channel.writer = writer
    end_with(parent)
    code = run_to_its_end(work)
    leave(code)
    return code


def read_space() -> float:
    """The address space in bytes that this process may use; inf where it is not limited."""
    import resource

    space = resource.getrlimit(resource.RLIMIT_AS)[0]
    return math.inf if space == resource.RLIM_INFINITY else float(space)


def run_to_its_end(work: Callable[[], int]) -> int:
    """Do the work and let the parent know that nothing is left to say."""
    try:
        code = work()
    except SystemExit:
        Channel.send("ended")
        raise
    except BaseException as fault:
        try:
            sys.excepthook(type(fault), fault, fault.__traceback__)
            sys.stderr.flush()
        except BaseException:  # no memory even for a message: the parent has some
            os._exit(FAILED)
        code = FAILED
    Channel.send("ended")
    return code


def leave(code: int) -> None:
    """End this process without freeing its objects one by one, a tenth of a report's time; not while threads or a profiler need more."""
    if threading.active_count() > 1 or sys.getprofile() is not None or sys.gettrace() is not None:
        return
    atexit._run_exitfuncs()
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def end_with(parent: int) -> None:
    """Have this process killed when its parent is."""
    with contextlib.suppress(ImportError, OSError, AttributeError, MemoryError):
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        os._exit(FAILED)


@dataclass
class Watch:
    """The parent's side: `deadline` by `time.perf_counter`, `seconds` and `memory` as the user knows them; the usual ones at first."""

    reader: int
    child: int = 0
    seconds: float = SECONDS
    memory: float = BYTES
    deadline: float = field(default_factory=lambda: time.perf_counter() + SECONDS)
    ended: bool = False
    interrupted: bool = False

    def pass_on(self, number: int, _: object) -> None:
        """Hand a request to end the program on to the work."""
        self.interrupted = True
        if self.child > 0:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.child, number)

    def wait(self) -> int:
        """Wait for the work, keep its limits, and return its exit code."""
        open_ends, why = {self.open_end(), self.reader}, ""
        while True:
            ready = select.select(list(open_ends), [], [], TICK)[0]
            if self.reader in ready and not self.listen():
                open_ends.discard(self.reader)
            done, status = os.waitpid(self.child, os.WNOHANG)
            if done:
                break
            why = why or self.excess()
            if why:
                os.kill(self.child, signal.SIGKILL)
        self.listen()
        return self.judge(os.waitstatus_to_exitcode(status), why)

    def open_end(self) -> int:
        """What can be read once the work has ended: a descriptor of it; the reader where there is none (old kernels, containers)."""
        try:
            return os.pidfd_open(self.child)
        except (AttributeError, OSError):
            return self.reader

    def listen(self) -> bool:
        """Take in what the work has sent; False once nothing more can come."""
        if not select.select([self.reader], [], [], 0)[0]:
            return True
        said = os.read(self.reader, 4096)
        for line in said.decode().splitlines():
            kind, *numbers = line.split()
            if kind == "limits":
                self.deadline, self.seconds, self.memory = map(float, numbers)
            self.ended |= kind == "ended"
        return bool(said)

    def excess(self) -> str:
        """Why the work must be ended now; empty where it need not."""
        if self.ended:
            return ""
        if time.perf_counter() > self.deadline:
            return (
                f"stopped at the time limit of {self.seconds:g} s, which it did not keep by itself; "
                f"allow more time (--limit-seconds above {self.seconds:g}, or seconds in the scene's [accuracy])"
            )
        if read_resident(self.child) > BEYOND * self.memory + LIBRARIES:
            return (
                f"stopped at the limit of memory of {self.memory:g} bytes, which it did not keep by itself; "
                f"allow more (--limit-memory above {self.memory:g}, or memory in the scene's [accuracy])"
            )
        return ""

    def judge(self, code: int, why: str) -> int:
        """Say what became of the work, where it could not say so itself; the exit code."""
        if self.ended and code >= 0:
            return code
        if not why and self.interrupted:
            why = INTERRUPTED
        if not why:
            how = f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"
            why = f"a library or the system ended the program ({how}); most often {NO_MEMORY}"
        print(f"flexlin: {why}", file=sys.stderr, flush=True)
        return FAILED
