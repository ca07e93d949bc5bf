"""A worker that is a copy of this process: its libraries and the work are loaded already, so it costs milliseconds in place of a second."""

import gc
import os
import select
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any, NoReturn

import numpy as np

READY = b"+"
PATIENCE = 5.0
"""Seconds in which a copy must say that it can compute; one of a process with threads might wait for a lock that nobody gives back."""
HELD_BACK = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM) if hasattr(signal, "SIGALRM") else ()
"""Signals that must not come between a copy and the note of it."""


def can_copy() -> bool:
    """Whether this system copies processes safely: macOS offers it, but its libraries do not endure it."""
    return sys.platform == "linux"


class Copy:
    """A copy of this process that runs `serve(asked, answers)` and ends; `stdin` and `stdout` are the other ends of the two streams.

    `others`: streams of other copies, which this one closes, so that these notice the end of their parent. Raises: OSError.
    """

    def __init__(self, serve: Callable[[IO[bytes], IO[bytes]], None], others: Sequence[IO[bytes]]):
        asked, ask = os.pipe()
        answer, answers = os.pipe()
        with hold_back_signals():
            try:
                self.pid = copy_process()
            except OSError:
                for end in (asked, ask, answer, answers):
                    os.close(end)
                raise
            if self.pid == 0:
                live_as_copy(
                    lambda: serve(os.fdopen(asked, "rb"), os.fdopen(answers, "wb")), (ask, answer), others, answers
                )
        os.close(asked)
        os.close(answers)
        self.stdin, self.stdout = os.fdopen(ask, "wb"), os.fdopen(answer, "rb")
        self._well = False

    def is_well(self) -> bool:
        """Whether it can compute: it has multiplied and decomposed matrices."""
        if not self._well:
            said = select.select([self.stdout], [], [], PATIENCE)[0]
            self._well = bool(said) and os.read(self.stdout.fileno(), 1) == READY
        return self._well

    def kill(self) -> None:
        """End it."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> Any:
        """Wait for its end."""
        with suppress(ChildProcessError):
            os.waitpid(self.pid, 0)


def copy_process() -> int:
    """`os.fork` without the warning that Python gives where there are threads: the copy says by itself whether it is well."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def live_as_copy(
    serve: Callable[[], None], ends: tuple[int, int], others: Sequence[IO[bytes]], answers: int
) -> NoReturn:
    """All that a copy does: nothing of what its original would do at its end."""
    try:
        gc.freeze()  # what is shared with the original stays so
        os.setsid()
        for number in HELD_BACK:
            signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, HELD_BACK)
        for end in (*ends, *(stream.fileno() for stream in others)):
            os.close(end)
        sys.stdout = sys.stderr = open(os.dup(2), "w")  # noqa: SIM115  the original's may be locked; it writes no answers there
        A = np.add.outer(np.arange(64.0), np.eye(64)[0])
        np.linalg.eigvals(A @ A + np.eye(64))
        os.write(answers, READY)
        serve()
    finally:
        os._exit(0)


@contextmanager
def hold_back_signals() -> Iterator[None]:
    """Let signals come after the block."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, HELD_BACK)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
