"""One run of the command line in a process of its own, what a part of the torture found, and the command lines that it runs."""

import atexit
import os
import re
import resource
import select
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tests.torture.scenes import FILES

LONGEST = 300.0
"""Seconds after which a run is killed."""
WATCHED = True
"""Whether a parent watches each run, as it does a user's: the libraries are then loaded anew for it."""


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
    code, taken = os.waitstatus_to_exitcode(status), time.monotonic() - start
    words, cpu = said.decode(errors="replace"), usage.ru_utime + usage.ru_stime
    return Trial(None if code < 0 else code, words, taken, 1024 * usage.ru_maxrss, cpu)


def begin(arguments: Sequence[str], writer: int, space: int | None) -> None:
    """The child's part: it never returns."""
    code = 99
    atexit._clear()  # what is left for the end of the tests is not the child's
    try:
        os.dup2(writer, 1)
        os.dup2(writer, 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        from flexlin.cli import entry, program

        if space is not None:
            used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
            resource.setrlimit(resource.RLIMIT_AS, (used + space, used + space))
        sys.argv = ["flexlin", *arguments]
        try:
            if WATCHED:
                entry()
            code = program.run_to_its_end(program.run_program)
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
        except BaseException as fault:  # what `entry` would leave to the interpreter
            sys.excepthook(type(fault), fault, fault.__traceback__)
            code = 1
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


KEYS = "links|motion|effects|control|designs|accuracy|parameters|model|schema|title|source|file|scene"
"""One of these stands in every message that names a key."""
KEYED = ("check", "commands")
"""The parts whose refusals are of scenes, and so must name one."""
QUICK = "spinning-link"
"""The scene of the runs that are killed: what it says matters less than when."""
COMMANDS = {
    "report": ["report"],
    "chart": ["chart", "--over", "motion.frequency=0.2:3:20"],
    "design": ["design", "--points", "16"],
    "simulate": ["simulate", "--periods", "1"],
    "export": ["export", "--points", "16"],
}
SMALL = ["links.0.modes=1", "effects.geometric_stiffening=off", "designs=[]"]
LOG = 'log={inputs={q1={column="u"}},outputs={q1={column="angle"},"tip.x"={column="x"}}}'
"""What the columns of `log_file` are to an arm with one joint."""
LATER = {
    "linearize": ["linearize", QUICK, "--points", "16"],
    "respond": ["respond", "single-link", "--push", "tip 1 N 20 ms", "--set", *SMALL],
    "tune": ["tune", "single-link", "--gain", "control.feedback.kp.0=2:4", "--set", *SMALL],
    "predict": ["predict", "single-link", "--window", "0.3", "--set", *SMALL, LOG],
    "identify": ["identify", "single-link", "--free", "effects.hub.inertia", "--window", "0.3", "--set", *SMALL, LOG],
}
"""More commands that write a set, on small scenes; --set comes last."""
SETS = {"report": "report", "chart": "chart", "design": "gains", "simulate": "simulation", "export": "export"}
ALL_SETS = {**SETS, "linearize": "coefficients", **{name: name for name in ("respond", "tune", "predict", "identify")}}
"""The sets that commands write."""


@dataclass
class Row:
    """What a part found; times in s, memory in bytes; `wrong` holds a line for each thing that should not be."""

    part: str
    runs: int = 0
    answered: int = 0
    uncaught: int = 0
    keyless: int = 0
    mixed: int = 0
    left: int = 0
    slowest: float = 0.0
    largest: int = 0
    wrong: list[str] = field(default_factory=list)

    def blame(self, kind: str, case: str) -> None:
        """Count one thing that should not be: "uncaught", "keyless", "mixed" or "left"."""
        setattr(self, kind, getattr(self, kind) + 1)
        self.wrong.append(f"{kind}: {case}")

    def count(self, trial: Trial, case: str) -> None:
        """Enter a run."""
        self.runs += 1
        self.answered += trial.code == 0
        self.slowest, self.largest = max(self.slowest, trial.seconds), max(self.largest, trial.memory)
        if trial.uncaught:
            self.blame("uncaught", f"{case}: {trial.code}: {trial.said[-300:]}")
        if self.part in KEYED and trial.code == 2 and not re.search(KEYS, trial.said):
            self.blame("keyless", f"{case}: {trial.said[:300]}")
        if min(trial.seconds, trial.cpu) > 60 or trial.memory > 2**30:
            self.wrong.append(f"costly: {case}: {trial.seconds:.1f} s, {trial.memory / 2**20:.0f} MiB")

    def line(self) -> str:
        """The row of the table."""
        cells = f"{self.runs:>6} {self.answered:>8} {self.uncaught:>8} {self.keyless:>7} {self.mixed:>5} {self.left:>4}"
        return f"{self.part:<9} {cells} {self.slowest:>8.1f} {self.largest / 2**20:>8.0f}"


@cache
def log_file() -> str:
    """Where a log stands that commands may read."""
    path = Path(tempfile.mkdtemp()) / "log.csv"
    path.write_text(FILES["log.csv"], encoding="utf-8")
    return str(path)


def case_of(command: str, change: str, folder: Path) -> list[str]:
    """The command line of a quick run, with time enough on a busy machine."""
    last = [change, "--out", str(folder), "--limit-seconds", "250"]
    if command in LATER:
        first, scene, *rest = LATER[command]
        log = ["--log", log_file()] if LOG in rest else []
        return [first, scene, *log, *rest, *([] if "--set" in rest else ["--set"]), *last]
    scene = {"design": "khang-2019", "export": "khang-2019"}.get(command, QUICK)
    first, *rest = COMMANDS[command]
    if command == "chart":
        rest = ["--over", "motion.joints.0.rate=3:4:4"]
    small = ["designs=[]"] if command == "report" else []
    return [first, scene, *rest, "--set", *small, *last]
