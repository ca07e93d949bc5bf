"""The work in a process of its own, watched by its parent: whatever becomes of it, there is a message, and it ends within its limits.

Python ends a stage between two instructions. It cannot end a single call of a compiled library, and a library that finds no memory may end
the process without a word. The parent loads no library, and only waits.
"""

import contextlib
import math
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flexlin.bounds import printable
from flexlin.resources import CLOCK_RATIO, LIMIT_BYTES, LIMIT_SECONDS, read_resident

if TYPE_CHECKING:
    from pathlib import Path

    from flexlin.scene.scene import Accuracy

DONE, FAILED, BAD_INPUT, OTHER_VERDICT, NO_ANSWER = range(5)
"""Exit codes."""
LOOK_INTERVAL = 0.1
"""Seconds between two looks at the work, and at the line that shows its progress."""
ENDING_SECONDS = 1.5
"""Seconds that Python takes to begin, and a process that is ended to give its memory back."""
LIBRARY_BYTES, LIBRARY_SPACE = 2.5e8, 4.5e8
"""Bytes that the libraries take, in memory and in address space: in less than that one of them, OpenBLAS, tries for ever to load."""
PASSED_ON = (signal.SIGINT, signal.SIGTERM)
INTERRUPTED = "interrupted; no file was left half-written"
NO_MEMORY = "there is not enough memory; ask for less at once"
CHANNEL = "FLEXLIN_CHANNEL"
"""The variable that says where the parent of the work listens, a descriptor, the parent's number, and when it began."""


class Channel:
    """How the work lets its parent know its limits, and that all has been said."""

    writer: int | None = None
    begun: float | None = None

    @classmethod
    def send(cls, *words: float | str) -> None:
        """Send one line."""
        if cls.writer is not None:
            with contextlib.suppress(OSError):
                os.write(cls.writer, (" ".join(map(str, words)) + "\n").encode())


def send_limits(begun: float, asked: "Accuracy") -> None:
    """Let the parent know what a scene's run may take; `begun` by `time.perf_counter`, which all processes share."""
    end = asked.patience * asked.last_end - min(ENDING_SECONDS, 0.05 * asked.seconds)
    Channel.send("limits", begun + end, asked.seconds, asked.memory)


def send_written(paths: "Sequence[Path]") -> None:
    """Let the parent know what stands already, whatever becomes of the rest."""
    Channel.send("wrote", " and ".join(map(printable, paths)))


def is_supervised() -> bool:
    """Whether this process is the work, which ends with its parent, or has to do it unwatched."""
    given = os.environ.pop(CHANNEL, None)
    if given is not None:
        writer, parent, begun = given.split()
        Channel.writer, Channel.begun = int(writer), float(begun)
        os.set_inheritable(Channel.writer, False)
        end_with(int(parent))
    return given is not None or sys.platform != "linux"


def supervise(work: Sequence[str]) -> int:
    """Run a program that prints its own messages, and return its exit code.

    Where it is ended by something else, or goes on beyond its limits, say so.
    """
    begun = time.perf_counter()
    if (space := read_space()) < LIBRARY_SPACE:
        got = f"got {space / 1e6:.0f} MB of address space, expected {LIBRARY_SPACE / 1e6:.0f} MB: raise ulimit -v"
        print(f"flexlin: {NO_MEMORY}; {got}", file=sys.stderr)
        return BAD_INPUT
    reader, writer = os.pipe()
    watch = Watch(reader, begun=begun, store=read_option(work, "--store"))
    if stated := read_limit(work):
        watch.seconds, watch.deadline = stated, begun + max(stated, ENDING_SECONDS)
    for number in PASSED_ON:
        signal.signal(number, watch.pass_on)
    given = {**os.environ, CHANNEL: f"{writer} {os.getpid()} {begun!r}"}
    try:
        watch.work = subprocess.Popen(work, env=given, pass_fds=(writer,))
    except OSError as error:
        print(f"flexlin: the work cannot be started: {error.strerror}", file=sys.stderr)
        return FAILED
    finally:
        take_signals()
    os.close(writer)
    return watch.wait()


def read_option(words: Sequence[str], name: str) -> str:
    """What a command line states for an option; empty where it states nothing."""
    for word, after in zip(words, [*words[1:], ""], strict=True):
        option, _, value = word.partition("=")
        if option == name:
            return value or after
    return ""


def read_limit(words: Sequence[str]) -> float:
    """The seconds that a command line states, which hold while the work is still being loaded; 0 where it states none."""
    with contextlib.suppress(ValueError):
        stated = float(read_option(words, "--limit-seconds"))
        return stated if 0 < stated < math.inf else 0.0
    return 0.0


def say_go_on(store: "Path | str | None") -> str:
    """How to go on, where a store keeps what was found."""
    return f"; the same command goes on from {store}" if store and os.path.exists(store) else ""


def take_signals() -> None:
    """Let requests to end the program come through, in it and in its work: each can say now that they came."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, PASSED_ON)


def read_space() -> float:
    """The address space in bytes that this process may use; inf where it is not limited."""
    import resource

    space = resource.getrlimit(resource.RLIMIT_AS)[0]
    return math.inf if space == resource.RLIM_INFINITY else float(space)


def end_with(parent: int) -> None:
    """Have this process killed when its parent is."""
    with contextlib.suppress(ImportError, OSError, AttributeError, MemoryError):
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        sys.exit(FAILED)


@dataclass
class Watch:
    """The parent's side: `begun` and `deadline` by `time.perf_counter`, `seconds` and `memory` as the user knows them, the usual ones at
    first; `code`: the exit code where the work has none of its own; `written`: what stands already; `store`: what keeps values."""

    reader: int
    work: "subprocess.Popen[bytes] | None" = None
    seconds: float = LIMIT_SECONDS
    memory: float = LIMIT_BYTES
    begun: float = field(default_factory=time.perf_counter)
    deadline: float = field(default_factory=lambda: time.perf_counter() + CLOCK_RATIO * LIMIT_SECONDS)
    ended: bool = False
    interrupted: bool = False
    code: int = FAILED
    written: str = ""
    store: str = ""

    def pass_on(self, number: int, _: object) -> None:
        """Hand a request to end the program on to the work."""
        self.interrupted = True
        if self.work is not None:
            self.work.send_signal(number)

    def wait(self) -> int:
        """Wait for the work, keep its limits, and return its exit code."""
        assert self.work is not None
        why, open_ = "", True
        while (code := self.work.poll()) is None:
            if open_:
                select.select([self.reader], [], [], LOOK_INTERVAL)
                open_ = self.listen()
            else:  # it has ended, or closed what it was given
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.work.wait(LOOK_INTERVAL)
            why = why or self.excess(self.work.pid)
            if why or (self.ended and time.perf_counter() > self.deadline):
                self.work.kill()
        self.listen()
        return self.judge(code, why)

    def listen(self) -> bool:
        """Take in what the work has sent; False once nothing more can come."""
        if not select.select([self.reader], [], [], 0)[0]:
            return True
        said = os.read(self.reader, 2**16)
        for kind, _, words in (line.partition(" ") for line in said.decode().splitlines()):
            if kind == "limits":
                self.deadline, self.seconds, self.memory = map(float, words.split())
            elif kind == "wrote":
                self.written = words
            elif kind == "ended":
                self.ended, self.code = True, int(words)
        return bool(said)

    def excess(self, work: int) -> str:
        """Why the work must be ended now; empty where it need not."""
        if self.ended:
            return ""
        if time.perf_counter() > self.deadline:
            self.code = NO_ANSWER
            return (
                f"stopped by the clock after {time.perf_counter() - self.begun:.3g} s, "
                f"with a time limit of {self.seconds:g} s: it did not end by itself in time; "
                f"allow more time (--limit-seconds above {self.seconds:g}, or seconds in the scene's [accuracy])"
            )
        if read_resident(work) > 1.2 * self.memory + LIBRARY_BYTES:  # it ends itself at the limit, if it can
            self.code = BAD_INPUT
            return (
                f"stopped at the limit of memory of {self.memory:,.0f} bytes, which it did not keep by itself; "
                f"allow more (--limit-memory above {self.memory:g}, or memory in the scene's [accuracy])"
            )
        return ""

    def judge(self, code: int, why: str) -> int:
        """Say what became of the work, where it could not say so itself; the exit code."""
        if self.ended:  # what Python clears away then has no say in it
            return self.code if code < 0 else code
        if not why and self.interrupted:
            why = INTERRUPTED
        if not why:
            how = f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"
            why = f"a library or the system ended the program ({how}); most often {NO_MEMORY}"
        if self.written:
            why += f"; what was known before stands in {self.written}"
        print(f"flexlin: {why}{say_go_on(self.store)}", file=sys.stderr, flush=True)
        return self.code
