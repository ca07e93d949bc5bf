"""The command line: parses, calls, prints.

Exit codes: 0 done, 2 bad input or usage (a request too large for memory too), 3 a verdict other than the required one, 4 a sound question
without a trustworthy answer, or without all of it in its time, 1 anything else.
"""

import argparse
import codecs
import io
import os
import signal
import sys
import threading
import time
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from flexlin import __version__
from flexlin.bounds import printable
from flexlin.cli import loops, scenes
from flexlin.cli.shared import OPTIONS, Command, parse_place
from flexlin.cli.supervised import (
    BAD_INPUT,
    FAILED,
    INTERRUPTED,
    NO_ANSWER,
    NO_MEMORY,
    PASSED_ON,
    Channel,
    is_supervised,
    say_go_on,
    supervise,
    take_signals,
)
from flexlin.errors import FlexlinError, InputError, NumericalError, OutputError, SceneError, TooLarge, lacks_memory
from flexlin.resources import Stopwatch

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
"""Variables by which a user says how many threads linear algebra has."""
MESSAGE_LENGTH = 1000
"""Characters of a line that says what is wrong: it may repeat what somebody else wrote."""
SIGNAL_SECONDS = 1.0
"""Seconds within which requests to end the program count as one: a terminal, and `timeout`, send theirs to all processes."""
COMMANDS = {one.name: one for one in (*vars(scenes).values(), *vars(loops).values()) if isinstance(one, Command)}
"""A new one is a function under `command`, in the file of what it is about."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; an error is one message on stderr."""
    options = parser().parse_args(arguments, argparse.Namespace(watch=Stopwatch(Channel.begun)))
    try:
        with ended_by_signal():
            return int(options.run(options))
    except FlexlinError as error:
        scene = getattr(options, "scene", None)
        named = scene is None or isinstance(error, (SceneError, OutputError))
        text = str(error) if named else f"{scene}: {error}"
        said = (printable(line, MESSAGE_LENGTH) for line in text.split("\n"))
        print("flexlin:", "\n".join(said), file=sys.stderr)
        if isinstance(error, (InputError, TooLarge)):
            return BAD_INPUT
        return NO_ANSWER if isinstance(error, NumericalError) else FAILED
    except MemoryError:
        print(f"flexlin: {NO_MEMORY}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"flexlin: {INTERRUPTED}{say_go_on(getattr(options, 'store', None))}", file=sys.stderr)
        return FAILED


class Interruption(KeyboardInterrupt):
    """A request to end the work; one that a library drops, in whose midst it strikes, comes again."""

    works = came = False

    def __del__(self) -> None:
        reached, where = self.__traceback__, ""  # the outermost call that it came to
        if reached is not None and reached.tb_next is not None:
            where = str(reached.tb_frame.f_globals["__name__"])
        if not where.startswith("flexlin."):
            ring_later(signal.SIGINT, 1.1 * SIGNAL_SECONDS)


@contextmanager
def ended_by_signal() -> Iterator[None]:
    """Let a request to end the program (SIGTERM) act as Ctrl-C does, and take several at once for one; handlers are restored.

    Raises: KeyboardInterrupt, also where a library has made an error of its own of it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    last = -SIGNAL_SECONDS

    def end(number: int, frame: Any) -> None:
        nonlocal last
        now = time.monotonic()
        if is_loading(frame):  # a library whose loading breaks off may say so in words of its own
            ring_later(number, 0.1)
        elif now - last >= SIGNAL_SECONDS:
            last, Interruption.came = now, True
            raise Interruption

    handlers = {number: signal.signal(number, end) for number in PASSED_ON}
    Interruption.works, Interruption.came = True, False
    try:
        yield
    except Exception as error:
        if time.monotonic() - last < SIGNAL_SECONDS:
            raise KeyboardInterrupt from error
        raise
    finally:
        Interruption.works = False
        for number, handler in handlers.items():
            signal.signal(number, handler)


def is_loading(frame: FrameType | None) -> bool:
    """Whether a module is being imported."""
    while frame is not None and frame.f_code.co_filename != "<frozen importlib._bootstrap>":
        frame = frame.f_back
    return frame is not None


def ring_later(number: int, seconds: float) -> None:
    """Send a signal to this process after some time, if it is still at work."""

    def ring() -> None:
        if Interruption.works:
            os.kill(os.getpid(), number)

    again = threading.Timer(seconds, ring)
    again.daemon = True
    again.start()


def entry() -> None:
    """The program `flexlin`, which says in one line whatever goes wrong."""
    open_closed_streams()
    if is_supervised():
        sys.exit(run_to_its_end(run_program))
    # a module in the folder of a scene is none of the program's
    path = [] if sys.path[0] in ("", os.getcwd()) else ["-P"]
    sys.exit(supervise([sys.executable, *path, "-m", "flexlin", *sys.argv[1:]]))


def run_to_its_end(work: Callable[[], int]) -> int:
    """Do the work and let the parent know how it ended, once nothing is left to say; without memory for a message, the parent has one."""
    try:
        take_signals()
        code = work()
    except SystemExit as end:
        Channel.send("ended", end.code if isinstance(end.code, int) else FAILED)
        raise
    except BaseException as fault:
        try:
            report_fault(type(fault), fault, fault.__traceback__)
        except BaseException:
            return FAILED
        code = FAILED
    Channel.send("ended", code)
    return code


def open_closed_streams() -> None:
    """Let what is written to a stream that the caller has closed, as in `flexlin list >&-`, go nowhere."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def write_plainly(error: UnicodeError) -> tuple[str, int]:
    """What a terminal gets that knows no −, ± or ⁷: -, +- and ^7, since a growth rate without sign or power is another one."""
    assert isinstance(error, UnicodeEncodeError)
    lost = error.object[error.start : error.end]
    words = unicodedata.normalize("NFKC", lost).translate({ord("−"): "-", ord("±"): "+-", ord("×"): "x", ord("μ"): "u"})
    power = "^" if lost[0] in "⁻⁰¹²³⁴⁵⁶⁷⁸⁹" else ""
    return power + words.encode("ascii", "replace").decode(), error.end


def run_program() -> int:
    """Run the command that the program was called with: a fault of flexlin itself is one line too, with exit code 1."""
    sys.unraisablehook, warnings.showwarning = pass_over, report_warning
    need_one_thread()
    codecs.register_error("plain", write_plainly)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain")
    try:
        code = main()
        sys.stdout.flush()
    except OSError as error:
        if not isinstance(error, BrokenPipeError):  # else the reader has gone, as in `flexlin list | head -1`
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
    """Take what was raised where Python can raise nothing, as in a destructor: a request to end rings again.

    What an interruption left behind, such as a loop of asyncio, may complain when it is destroyed: that is no news.
    """
    if isinstance(lost.exc_value, KeyboardInterrupt):
        ring_later(signal.SIGINT, 1.1 * SIGNAL_SECONDS)
    elif not Interruption.came:
        kind = "" if lost.exc_type is None else lost.exc_type.__name__
        print(f"flexlin: note: {kind} where nothing can be raised: {lost.exc_value}", file=sys.stderr)


class Parser(argparse.ArgumentParser):
    """A parser that repeats of a mistake what a terminal can show, beside what the command at hand takes."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Refuse what is left over, which argparse leaves to the program's own parser."""
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            self.error(f"unrecognized arguments: {' '.join(rest)}")
        return found, rest

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the command line, and exit."""
        if message.endswith("required: SCENE"):
            message += ", before options that take several words, as --set does"
        super().error(printable(message, MESSAGE_LENGTH))


class PrintCompletion(argparse.Action):
    """Print what a shell needs to complete commands, options and the names of files, and exit."""

    def __call__(self, top: argparse.ArgumentParser, given: Any, shell: Any, option: str | None = None) -> None:
        try:
            import shtab
        except ImportError:
            top.error("completion needs shtab: pip install flexlin[completion]")
        pending = [top]
        while pending:
            for action in pending.pop()._actions:
                if isinstance(action, argparse._SubParsersAction):
                    pending += action.choices.values()
                elif action.dest in ("scene", "like", "robot") or action.type is parse_place:
                    action.complete = shtab.FILE  # type: ignore[attr-defined]
        print(shtab.complete(top, shell))
        top.exit()


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = Parser(
        prog="flexlin", description="Linearization, Floquet stability and control of light robot arms whose links bend."
    )
    top.add_argument("--version", action="version", version=f"flexlin {__version__}")
    top.add_argument(
        "--print-completion",
        action=PrintCompletion,
        metavar="SHELL",
        choices=("bash", "zsh", "tcsh"),
        help="print the completion script of bash, zsh or tcsh",
    )
    names = top.add_subparsers(metavar="COMMAND", dest="command", required=True)
    for found in COMMANDS.values():
        command = names.add_parser(found.name, help=found.purpose, description=found.purpose)
        for option in found.takes:
            flag, settings = OPTIONS[option]
            command.add_argument(flag, **settings)
        command.set_defaults(run=found.run, takes=found.takes)
    return top
