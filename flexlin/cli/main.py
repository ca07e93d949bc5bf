"""The command line: parses, calls, prints.

Exit codes: 0 done, 2 bad input or usage (a request too large for memory too), 3 a verdict other than the required one, 1 anything else.
"""

import argparse
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flexlin import __version__
from flexlin.cli import commands as run
from flexlin.cli.commands import BAD_INPUT, FAILED
from flexlin.errors import FlexlinError, InputError, OutputError, SceneError, TooLarge


def count(text: str) -> int:
    """Read a whole number from 2 on."""
    number = int(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"got {number}, expected a whole number from 2 on")
    return number


def span(text: str) -> tuple[str, float, float, int | None]:
    """Read KEY=LOW:HIGH or KEY=LOW:HIGH:COUNT."""
    key, _, values = text.partition("=")
    low, high, *rest = values.split(":")
    found = (key.strip(), float(low), float(high), count(rest[0]) if rest else None)
    if not key.strip() or not found[1] < found[2] or len(rest) > 1:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected KEY=LOW:HIGH:COUNT with LOW below HIGH")
    return found


OPTIONS: dict[str, tuple[list[str], dict[str, Any]]] = {
    "scene": (["scene"], {"metavar": "SCENE", "help": "a built-in name (see flexlin list) or a TOML file"}),
    "set": (
        ["--set"],
        {"dest": "overrides", "metavar": "KEY=VALUE", "action": "extend", "nargs": "+", "default": [],
         "help": "override a number of the scene, such as effects.payload.mass=0.3"},
    ),
    "out": (["--out"], {"type": Path, "default": Path(), "metavar": "DIR", "help": "folder for the results (default: here)"}),
    "require": (["--require"], {"choices": ["stable"], "help": "exit with code 3 when a verdict is another one"}),
    "points": (["--points"], {"type": count, "default": 256, "help": "times in a period (default 256)"}),
    "periods": (["--periods"], {"type": float, "default": 5.0, "help": "length of the simulation (default 5)"}),
    "feedforward": (
        ["--feedforward"],
        {"choices": ["scene", "rigid", "joint-exact", "tip-exact"], "default": "scene",
         "help": "what to feed forward (default: as in the scene); tip-exact keeps the tip on its path"},
    ),
    "attraction": (
        ["--attraction"], {"action": "store_true", "help": "also find how far a disturbance may go (some seconds)"},
    ),
    "animate": (["--animate"], {"action": "store_true", "help": "also write animation.html, which plays the simulation"}),
    "effects": (["--effects"], {"action": "store_true", "help": "also find which effects matter (some seconds)"}),
    "over": (
        ["--over"],
        {"type": span, "metavar": "KEY=LOW:HIGH[:COUNT]", "action": "extend", "nargs": "+", "required": True,
         "help": "a parameter to vary, such as motion.frequency=0.2:3:200; give two for a map"},
    ),
    "sensitivity": (
        ["--sensitivity"],
        {"action": "store_true", "help": "also find which numbers move the growth rate (some seconds)"},
    ),
    "tol": (["--tol"], {"type": float, "metavar": "ERROR", "help": "wanted error of every stage (default 1e-9, or as in the scene)"}),
    "seconds": (
        ["--limit-seconds"],
        {"type": float, "metavar": "S", "help": "time that a stage may take (default 60, or as in the scene)"},
    ),
    "memory": (
        ["--limit-memory"],
        {"type": float, "metavar": "BYTES", "help": "memory that a stage may ask for at once (default 2^30, or as in the scene)"},
    ),
    "tolerance": (["--tolerance"], {"type": float, "default": 0.01, "help": "relative change that matters (default 0.01)"}),
}  # fmt: skip
SCENE = ("scene", "set", "out")
LIMITS = ("seconds", "memory")
COMPUTED = (*SCENE, "tol", *LIMITS)
COMMANDS: dict[str, tuple[Any, ...]] = {
    "list": (run.list_scenes, "name the scenes that travel with flexlin"),
    "check": (run.check, "read a scene and derive its equations", *SCENE),
    "report": (run.report, "write report.html and report.json", *COMPUTED, "require", "effects", "sensitivity"),
    "linearize": (run.write_coefficients, "write the coefficients over a period", *SCENE, *LIMITS, "points"),
    "design": (run.write_gains, "design the scene's controllers, write their gains", *COMPUTED, "require", "points"),
    "simulate": (
        run.write_simulation,
        "integrate the nonlinear equations beside the linear ones",
        *COMPUTED,
        "periods",
        "feedforward",
        "attraction",
        "animate",
    ),
    "effects": (run.audit_effects, "find which effects and modes the scene needs", *COMPUTED, "tolerance"),
    "chart": (run.write_chart, "stability over one or two parameters", *COMPUTED, "over"),
    "cost": (run.write_cost, "measure what accuracy costs in time, beside other programs (a minute)", *SCENE),
    "export": (run.export, "write system and designs for other tools: npz, MATLAB, netCDF, C", *COMPUTED, "points"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; an error is one message on stderr."""
    options = parser().parse_args(arguments)
    try:
        with ended_by_signal():
            return int(options.run(options))
    except FlexlinError as error:
        print(f"flexlin: {with_scene(error, options)}", file=sys.stderr)
        return BAD_INPUT if isinstance(error, (InputError, TooLarge)) else FAILED
    except KeyboardInterrupt:
        print("flexlin: interrupted; no file was left half-written", file=sys.stderr)
        return FAILED


@contextmanager
def ended_by_signal() -> Iterator[None]:
    """Let a request to end the program (SIGTERM) act as Ctrl-C does; the handler of before is restored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, handler)


def with_scene(error: FlexlinError, options: argparse.Namespace) -> str:
    """The error's message, after the scene's name where it does not name one itself."""
    scene = getattr(options, "scene", None)
    return str(error) if scene is None or isinstance(error, (SceneError, OutputError)) else f"{scene}: {error}"


def entry() -> None:
    """The program `flexlin`: a fault of flexlin itself is one line too, with exit code 1."""
    sys.excepthook = report_fault
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
        print(f"flexlin: the output cannot be written: {error.strerror}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = FAILED
    sys.exit(code)


def report_fault(kind: type[BaseException], fault: BaseException, trace: Any) -> None:
    """Say in one line what went wrong inside flexlin, and where."""
    while trace.tb_next is not None:
        trace = trace.tb_next
    where = f"{Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno}"
    print(f"flexlin: a fault of flexlin, please report it: {kind.__name__} in {where}: {fault}", file=sys.stderr)


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = argparse.ArgumentParser(
        prog="flexlin", description="Linearization, Floquet stability and control of light robot arms whose links bend."
    )
    top.add_argument("--version", action="version", version=f"flexlin {__version__}")
    names = top.add_subparsers(metavar="COMMAND", dest="command", required=True)
    for name, (function, purpose, *options) in COMMANDS.items():
        command = names.add_parser(name, help=purpose, description=purpose)
        for option in options:
            flags, settings = OPTIONS[option]
            command.add_argument(*flags, **settings)
        command.set_defaults(run=function)
    return top
