"""The command line: parses, calls, prints.

Exit codes: 0 done, 2 bad input or usage (a request too large for memory too), 3 a verdict other than the required one, 1 anything else.
"""

import argparse
import io
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flexlin import __version__
from flexlin.cli.commands import COMMANDS
from flexlin.cli.options import OPTIONS
from flexlin.cli.shared import BAD_INPUT, FAILED
from flexlin.cli.supervised import INTERRUPTED, NO_MEMORY, PASSED_ON, Channel, is_supervised, supervise
from flexlin.errors import FlexlinError, InputError, OutputError, SceneError, TooLarge
from flexlin.errors.root import lacks_memory

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Variables by which a user says how many threads linear algebra has."""
AGAIN = 1.0
"""Seconds within which requests to end the program count as one: a terminal, and `timeout`, send theirs to all processes."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; an error is one message on stderr."""
    options = parser().parse_args(arguments, argparse.Namespace(begun=time.perf_counter()))
    try:
        with ended_by_signal():
            return int(options.run(options))
    except FlexlinError as error:
        print(f"flexlin: {with_scene(error, options)}", file=sys.stderr)
        return BAD_INPUT if isinstance(error, (InputError, TooLarge)) else FAILED
    except MemoryError:
        print(f"flexlin: {NO_MEMORY}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"flexlin: {INTERRUPTED}", file=sys.stderr)
        return FAILED


@contextmanager
def ended_by_signal() -> Iterator[None]:
    """Let a request to end the program (SIGTERM) act as Ctrl-C does, and take several at once for one; handlers are restored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last = -AGAIN

    def end(number: int, frame: Any) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= AGAIN:
            last = now
            signal.default_int_handler(number, frame)

    handlers = {number: signal.signal(number, end) for number in PASSED_ON}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def with_scene(error: FlexlinError, options: argparse.Namespace) -> str:
    """The error's message, after the scene's name where it does not name one itself."""
    scene = getattr(options, "scene", None)
    return str(error) if scene is None or isinstance(error, (SceneError, OutputError)) else f"{scene}: {error}"


def entry() -> None:
    """The program `flexlin`, which says in one line whatever goes wrong."""
    open_closed_streams()
    if is_supervised():
        sys.exit(run_to_its_end(run_program))
    path = (
        [] if sys.path[0] in ("", os.getcwd()) else ["-P"]
    )  # a module in the folder of a scene is none of the program's
    sys.exit(supervise([sys.executable, *path, "-m", "flexlin", *sys.argv[1:]]))


def run_to_its_end(work: Callable[[], int]) -> int:
    """Do the work and let the parent know that nothing is left to say; without memory for a message, the parent has one."""
    try:
        code = work()
    except SystemExit:
        Channel.send("ended")
        raise
    except BaseException as fault:
        try:
            report_fault(type(fault), fault, fault.__traceback__)
        except BaseException:
            return FAILED
        code = FAILED
    Channel.send("ended")
    return code


def open_closed_streams() -> None:
    """Let what is written to a stream that the caller has closed, as in `flexlin list >&-`, go nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def run_program() -> int:
    """Run the command that the program was called with: a fault of flexlin itself is one line too, with exit code 1."""
    sys.unraisablehook, warnings.showwarning = pass_over, report_warning
    need_one_thread()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that knows no ± gets a question mark
    try:
        code = main()
        sys.stdout.flush()
    except BrokenPipeError:  # the reader has gone, as in `flexlin list | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    except OSError as error:
        why = NO_MEMORY if lacks_memory(error) else f"the output cannot be written: {error.strerror}"
        print(f"flexlin: {why}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    return code


def need_one_thread() -> None:
    """Let linear algebra use one thread, unless the user says how many: with a few dozen rows threads wait for each other.

    It must be said before NumPy is loaded.
    """
    if not any(name in os.environ for name in THREADS):
        os.environ.update(dict.fromkeys(THREADS, "1"))


def report_warning(
    message: Warning | str, category: type[Warning], filename: str, lineno: int, file: Any = None, line: Any = None
) -> None:
    """Say in one line what a library warns of outside the stages of the work, whose own notes hold theirs."""
    print(f"flexlin: note: {category.__name__} in {Path(filename).stem}: {message}", file=sys.stderr)


def report_fault(kind: type[BaseException], fault: BaseException, trace: Any) -> None:
    """Say in one line what went wrong inside flexlin, and where; memory that gave out, and Ctrl-C, are nobody's fault."""
    if isinstance(fault, KeyboardInterrupt) or lacks_memory(fault):
        print(f"flexlin: {INTERRUPTED if isinstance(fault, KeyboardInterrupt) else NO_MEMORY}", file=sys.stderr)
        return
    while trace.tb_next is not None:
        trace = trace.tb_next
    where = f"{Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno}"
    print(f"flexlin: a fault of flexlin, please report it: {kind.__name__} in {where}: {fault}", file=sys.stderr)


def pass_over(lost: Any) -> None:
    """Take what was raised where Python can raise nothing, as in a destructor: a limit rings again, and so does a request to end."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        again = threading.Timer(1.1 * AGAIN, os.kill, (os.getpid(), signal.SIGINT))
        again.daemon = True
        again.start()
    elif not isinstance(lost.exc_value, FlexlinError):
        kind = "" if lost.exc_type is None else lost.exc_type.__name__
        print(f"flexlin: note: {kind} where nothing can be raised: {lost.exc_value}", file=sys.stderr)


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = argparse.ArgumentParser(
        prog="flexlin", description="Linearization, Floquet stability and control of light robot arms whose links bend."
    )
    top.add_argument("--version", action="version", version=f"flexlin {__version__}")
    names = top.add_subparsers(metavar="COMMAND", dest="command", required=True)
    for name, module in COMMANDS.items():
        command = names.add_parser(name, help=module.PURPOSE, description=module.PURPOSE)
        for option in module.TAKES:
            flags, settings = OPTIONS[option]
            command.add_argument(*flags, **settings)
        command.set_defaults(run=module.run)
    return top
