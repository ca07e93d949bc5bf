"""One run of the command line in a process of its own: what it said, what it took, how it ended."""

import atexit
import os
import resource
import select
import signal
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

LONGEST = 300.0
"""Seconds after which a run is killed."""


@dataclass(frozen=True)
class Trial:
    """How a run ended: exit code (None where a signal ended it), what it wrote, wall and processor time in s, the most memory in bytes."""

    code: int | None
    said: str
    seconds: float
    memory: int
    cpu: float = 0.0

    @property
    def uncaught(self) -> bool:
        """Whether an exception came through, or a signal that nobody sent."""
        return self.code is None or "a fault of flexlin" in self.said or "Traceback" in self.said


def run(arguments: Sequence[str], stop_after: Callable[[int], None] | None = None, space: int | None = None) -> Trial:
    """Run `flexlin` with these arguments in a fork of this process, where flexlin is loaded already.

    Parameters: stop_after: called with the child's id, may wait and then kill it; space: bytes of address space beyond what is in use.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    reader, writer = os.pipe()
    start = time.monotonic()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # other threads of this process hold nothing that the child needs
        child = os.fork()
    if child == 0:
        os.close(reader)
        begin(arguments, writer, space)
    os.close(writer)
    if stop_after is not None:
        stop_after(child)
    said, ended = b"", False
    while not ended:
        ready, _, _ = select.select([reader], [], [], max(0.1, LONGEST - (time.monotonic() - start)))
        part = os.read(reader, 65536) if ready else b""
        said, ended = said + part, bool(ready) and not part
        if not ready:
            os.kill(child, signal.SIGKILL)
    os.close(reader)
    _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    memory = 1024 * usage.ru_maxrss
    taken, cpu = time.monotonic() - start, usage.ru_utime + usage.ru_stime
    return Trial(None if code < 0 else code, said.decode(errors="replace"), taken, memory, cpu)


def resident(which: int = 1) -> int:
    """Bytes that this process has in memory (1) or in its address space (0)."""
    return int(Path("/proc/self/statm").read_text().split()[which]) * os.sysconf("SC_PAGE_SIZE")


def begin(arguments: Sequence[str], writer: int, space: int | None) -> None:
    """The child's part: it never returns."""
    code = 99
    atexit._clear()  # what is left for the end of the tests is not the child's
    try:
        os.dup2(writer, 1)
        os.dup2(writer, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        from flexlin.cli import entry

        if space is not None:
            resource.setrlimit(resource.RLIMIT_AS, (resident(0) + space, resident(0) + space))
        sys.argv = ["flexlin", *arguments]
        try:
            entry()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        except BaseException as fault:  # what `entry` would leave to the interpreter
            sys.excepthook(type(fault), fault, fault.__traceback__)
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)
