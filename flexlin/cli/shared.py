"""What the commands share: the table of options, reading the scene, its clock and progress, writing the results, exit codes."""

import argparse
import math
import shlex
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import flexlin.scene
from flexlin import analyses, files, report
from flexlin.bounds import read_number
from flexlin.cli.supervised import DONE, LOOK_INTERVAL, send_limits
from flexlin.errors import ArgumentError, OutputError
from flexlin.resources import LIMIT_BYTES, LIMIT_SECONDS, listening

if TYPE_CHECKING:
    import xarray

    from flexlin.analyses.clock import Clock
    from flexlin.analyses.judging import Loop, ModelValidity
    from flexlin.report.figures import Picture
    from flexlin.scene.scene import Scene

LIMIT = f"{LIMIT_BYTES:.0e}".replace("+0", "")
"""Of memory, as one would write it."""
SEARCH_SECONDS = 600.0
"""Limit in s of a search or a fit where nobody states one."""
ACCURACY = {"tol": "tol", "limit_seconds": "seconds", "limit_memory": "memory"}
"""Options that stand for a key of the scene's table [accuracy]."""
UNQUOTED = ("scene", "out", "require", "workers", "scheduler")
"""Options that change where results go and who computes them, but not what they are; the scene is said first."""


Named = Mapping[str, Any]


def count(text: str) -> int:
    """Read a whole number from 2 on."""
    number = int(text) if text.strip().isdecimal() else 0
    if number < 2:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a whole number from 2 on")
    return number


def parse_place(text: str) -> Path:
    """Read the name of a file or folder."""
    if not text.strip():
        raise argparse.ArgumentTypeError("got an empty name, expected that of a file or folder")
    return Path(text)


Span = tuple[str, Any, Any, int | None]
"""A key with its limits, numbers or quantities as written, and how many values."""


def span(text: str) -> Span:
    """Read KEY=LOW:HIGH or KEY=LOW:HIGH:COUNT."""
    key, _, values = text.partition("=")
    low, high, *rest = values.split(":") if values.count(":") in (1, 2) else ("", "")
    if not (key.strip() and low.strip() and high.strip()):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected KEY=LOW:HIGH with LOW below HIGH")
    return key.strip(), low, high, count(rest[0]) if rest else None


def read_span(scene: "Scene", asked: Span) -> Span:
    """The limits in the key's unit. Raises: ArgumentError."""
    key, *limits, number = asked

    def read(limit: str) -> Any:
        try:
            return read_number(limit)
        except ValueError:
            sliding = flexlin.scene.all_slide([{"joint": link.joint} for link in scene.links])
            return flexlin.scene.in_unit(limit, flexlin.scene.name_unit(scene, key), sliding)

    low, high = map(read, limits)
    if isinstance(low, str) or isinstance(high, str) or not low < high:
        unit = flexlin.scene.name_unit(scene, key)
        expected = f"LOW:HIGH, LOW below HIGH{', numbers' + flexlin.scene.name_units(unit) if unit else ''}"
        raise ArgumentError(f"{key} has no range", got=":".join(limits), expected=expected)
    return key, low, high, number


def option(flag: str, metavar: str | None, words: str, **more: Any) -> tuple[str, dict[str, Any]]:
    """A row of the table of options: what `add_argument` takes."""
    return flag, {"help": words, **({} if metavar is None else {"metavar": metavar}), **more}


PLACE: dict[str, Any] = {"type": parse_place}
WORDS: dict[str, Any] = {"action": "extend", "nargs": "+"}
SPANS: dict[str, Any] = {"type": span, **WORDS}
SWITCH: dict[str, Any] = {"action": "store_true"}
RANGE = "KEY=LOW:HIGH"
OPTIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "scene": option("scene", "SCENE", "a built-in name (see flexlin list) or a TOML file"),
    "name": option("name", "NAME", "of the new scene, which is written to NAME.toml", **PLACE),
    "like": option("--like", "SCENE", "the scene to start from (default: single-link)", default="single-link"),
    "set": option(
        "--set", "KEY=VALUE",
        "override values of the scene, in SI units or with their own: effects.payload.mass=0.3 links.0.length='960 mm'; lists in "
        "brackets: control.feedback.kp=[5,2]; an effect on by its whole table: effects.shear={stiffness=1e5}, or off: effects.gravity=off; "
        "what stands in a model's [parameters] also without that word: links.0.modes=5",
        dest="overrides", default=[], **WORDS,
    ),
    "data": option("--data", "DIR", "folder whose files the scene may name, beside its own", **PLACE),
    "out": option("--out", "DIR", "folder for the results (default: out/ and the scene's name)", **PLACE),
    "require": option(
        "--require", None,
        "exit with code 3 unless the loop is stable in a linear model that holds along the motion as far as is known (stable), was "
        "found to hold by simulation (valid), or may hold or not (linear-stable)",
        choices=["stable", "valid", "linear-stable"],
    ),
    "points": option("--points", None, "times in a period (default 256)", type=count, default=256),
    "periods": option("--periods", None, "length of the simulation (default 5)", type=float, default=5.0),
    "feedforward": option(
        "--feedforward", None, "what to feed forward (default: as in the scene); tip-exact keeps the tip on its path",
        choices=["scene", "rigid", "joint-exact", "tip-exact"], default="scene",
    ),
    "attraction": option("--attraction", None, "also find how far a disturbance may go (some seconds)", **SWITCH),
    "animate": option("--animate", None, "also write animation.html, which plays the simulation", **SWITCH),
    "effects": option("--effects", None, "also find which effects matter (some seconds)", **SWITCH),
    "over": option(
        "--over", f"{RANGE}[:COUNT]",
        "a parameter to vary, such as motion.frequency=0.2:3:200 or effects.payload.mass='0:300 g'; give two for a map",
        required=True, **SPANS,
    ),
    "vary": option(
        "--vary", RANGE, "a number that scenarios differ by, such as effects.payload.mass=0:0.3", default=[], **SPANS
    ),
    "gain": option(
        "--gain", RANGE,
        "a gain to tune and its limits (default: all of the scene's feedback, a tenth to ten times their values)",
        default=[], **SPANS,
    ),
    "loop": option(
        "--loop", "LOOP", "own (default), open, a design's name, whose gain is kept, or 'NAME, redone' at each value", default="own"
    ),
    "workers": option("--workers", "N", "processes or threads that share the values (default: all cores)", type=int),
    "scheduler": option("--scheduler", "ADDRESS", "a Dask cluster that does the work, such as tcp://host:8786"),
    "store": option("--store", "FOLDER", "keep finished values; the same command goes on where it stopped", **PLACE),
    "margins": option(
        "--margins", RANGE,
        "numbers whose critical values are looked for, with ranges (default: speed and payload, about a second for both)",
        default=[], **SPANS,
    ),
    "loop_margins": option(
        "--loop-margins", None, "also find which gain, phase and delay each loop endures (some seconds a loop)", **SWITCH
    ),
    "sensitivity": option(
        "--sensitivity", None, "also find which numbers move the growth rate (some seconds)", **SWITCH
    ),
    "tol": option("--tol", "ERROR", "wanted error of every stage (default 1e-9, or as in the scene)", type=float),
    "seconds": option(
        "--limit-seconds", "S", f"time by the clock for all (default {LIMIT_SECONDS:g} of the processor, tune 600, or the scene's)",
        type=float,
    ),
    "memory": option(
        "--limit-memory", "BYTES", f"memory that it may hold beside its libraries (default {LIMIT}, or as in the scene)", type=float
    ),
    "log": option("--log", "FILE", "a measured log: CSV with a head line, .npz or .nc", required=True, **PLACE),
    "free": option(
        "--free", "KEY", "numbers to find, such as effects.payload.mass or log.outputs.gauge.gain", required=True, **WORDS
    ),
    "log_effects": option(
        "--effects", "NAME", "also find which effects the log calls for: some by name, or all that the scene lacks (minutes)",
        dest="log_effects", action="extend", nargs="*",
    ),
    "hold_back": option(
        "--hold-back", "SHARE", "last part of the log, predicted but not fitted (default a third)", type=float, default=1 / 3
    ),
    "window": option("--window", "S", "length of each prediction (default 2)", type=float, default=2.0),
    "step": option("--step", "WORDS", 'a torque from a moment on, such as "joint 1 torque 0.1 N m"'),
    "initial": option("--initial", "WORDS", 'a state beside the steady motion, such as "w11=0.01, q1_rate=5 deg/s"'),
    "push": option("--push", "WORDS", 'a force at the tip for a time, such as "tip 1 N 20 ms" or "tip y 1 N 20 ms"'),
    "noise": option("--noise", "WORDS", 'torque noise, such as "torque 0.05 N m 100 Hz"'),
    "of": option("--loop", "NAME", "own, or the name of a design (default own)", dest="of", default="own"),
    "lasting": option("--periods", None, "how long to look (default: until a thousandth is left)", dest="lasting", type=float),
    "robot": option("robot", "ROBOT.URDF", "a URDF file; no mesh is read", **PLACE),
    "file": option("--out", "FILE.TOML", "the scene to write", required=True, **PLACE),
    "base": option("--base", "LINK", "first link of the chain (default: the root)"),
    "tip": option("--tip", "LINK", "last link of the chain (default: the only end)"),
    "tolerance": option("--tolerance", None, "relative change that matters (default 0.01)", type=float, default=0.01),
}  # fmt: skip


@dataclass(frozen=True)
class Command:
    """A row of the table of commands: reads the options that it takes, calls the library, prints and writes; returns the exit code."""

    name: str
    purpose: str
    takes: list[str]
    run: Callable[[argparse.Namespace], int]


def command(name: str, purpose: str, takes: str = "") -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Make a function the command of this name."""
    return lambda run: Command(name, purpose, takes.split(), run)


def scene_command(
    name: str, purpose: str, takes: str = "", tol: bool = True, usual: float | None = None
) -> Callable[[Callable[["Work", argparse.Namespace], int]], Command]:
    """Make a function of the work on a scene, and of options, the command of this name; `tol`: whether stages are asked for an error."""
    every = f"scene set data out {'tol ' * tol}seconds memory {takes}"
    return lambda run: command(name, purpose, every)(lambda options: run(Work(options, usual), options))


SILENT_SECONDS = 2.0
"""Seconds of silence before progress is shown."""
PROGRESS_SECONDS = 5.0
"""Seconds between two lines in a pipe; between two of the same step and share it is a minute."""


class Progress:
    """Shows the step at hand, how much is done and how long the rest may take, once the work has taken longer than two seconds.

    Use as a context manager, which listens to what calculations say of themselves, and call it with the name of each step.
    """

    def __init__(self) -> None:
        self._name, self.share, self._left = "", 0.0, math.inf
        self._over = threading.Event()
        self._listening = listening(self._advance)
        self._start, self._written, self._said = time.perf_counter(), 0.0, ("", 0.0)
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __call__(self, name: str) -> None:
        self._name = str(name)

    def _advance(self, share: float) -> None:
        """Take a share; what was done once stays done."""
        self.share = max(self.share, min(share, 1.0))

    @property
    def line(self) -> str:
        """What is shown; a time left that was too short is not taken back, but no longer shown."""
        share, elapsed = self.share, time.perf_counter() - self._start
        if share < 0.02:  # too early for a guess
            return f"{self._name} ({elapsed:.0f} s so far)"
        left = elapsed * (1 - share) / share
        if left > 1.5 * self._left + LOOK_INTERVAL:
            return f"{100 * share:.0f} %, {elapsed:.0f} s so far: {self._name}"
        self._left = min(left, self._left)
        return f"{100 * share:.0f} %, about {self._left:.0f} s left: {self._name}"

    def __enter__(self) -> "Progress":
        self._start = time.perf_counter()
        self._listening.__enter__()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.__exit__(None, None, None)
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        """Show the line from time to time, until the work is over."""
        stderr = sys.__stderr__
        if self._over.wait(SILENT_SECONDS) or stderr is None or sys.stderr is not stderr:
            return  # over already, or a program has put a stream of its own there and reads errors from it
        if stderr.isatty():
            from rich.console import Console

            with Console(stderr=True).status(self.line) as status:
                while not self._over.wait(LOOK_INTERVAL):
                    status.update(self.line)
        while not self._over.wait(LOOK_INTERVAL):
            self._in_pipe()

    def _in_pipe(self) -> None:
        now, saying = time.perf_counter(), (self._name, self.share)
        if now - self._written >= (60.0 if saying == self._said else PROGRESS_SECONDS):
            self._written, self._said = now, saying
            print(f"flexlin: {self.line}", file=sys.stderr, flush=True)


class Work:
    """What most commands do alike: read the scene, compute under a clock while progress is shown, write the results as one set.

    Parameters: usual: the limit in s where nobody states one.
    """

    def __init__(self, options: argparse.Namespace, usual: float | None = None):
        self.options, self.scene = options, loaded(options, usual)
        self.quoted = quote(options)

    @contextmanager
    def clock(self, planned: int = 0) -> "Iterator[Clock]":
        """The clock of the stages within; `planned`: how many there will be, where that is known."""
        with Progress() as self.progress:
            self.progress("load the numerical libraries")
            self.kept = analyses.Clock(self.scene.accuracy, self.progress, planned, self.options.watch)
            yield self.kept

    def say_accuracy(self) -> None:
        """Print what was asked, reached and taken."""
        print("\n".join(report.accuracy_lines(tuple(self.kept.steps))))

    def page(self, pictures: "Sequence[Picture]", said: Sequence[str] = ()) -> str:
        """A page of pictures, below what is to be said before them."""
        return str(report.picture_page(self.scene.title, pictures[0], self.quoted, pictures[1:], said))

    def write(
        self, name: str, pictures: "list[Picture]", record: Named, said: Sequence[str] = (), more: Named | None = None
    ) -> int:
        """Write NAME.html with the pictures, NAME.json with the numbers, and more files of text; done."""
        data = report.to_json({"schema": 1, "title": self.scene.title, **record})
        texts = {f"{name}.html": self.page(pictures, said), f"{name}.json": data, **(more or {})}
        return print_paths(self.write_files(name, texts))

    def write_files(self, name: str, texts: Mapping[str, str], data: "xarray.Dataset | None" = None) -> list[Path]:
        """Write files of text, and a dataset as NAME.nc, as one set; returns where they are."""
        with files.results(self.options.out, name) as made:
            for file, text in texts.items():
                (made / file).write_text(text, encoding="utf-8")
            return made.placed(*texts) + ([] if data is None else report.write_dataset(data, made, name))


COLOURS = {"stable": "green", "unstable": "red", "undecided": "yellow", "one-way": "yellow", "failed": "red"}


def say_loop(loop: "Loop", period: float, model: "ModelValidity") -> None:
    """Print the verdict on a loop: on a terminal in its colour, or in that of doubt."""
    line = report.loop_line(loop, period, model)
    if not sys.stdout.isatty():
        print(line)
        return
    from rich.console import Console
    from rich.text import Text

    text = Text(line)
    text.highlight_words([loop.verdict], f"{COLOURS[report.colour(loop, period, model)]} bold")
    Console(highlight=False, soft_wrap=True).print(text)


def loaded(options: argparse.Namespace, usual: float | None = None) -> "Scene":
    """The scene with its overrides, once the output folder has been found usable; `usual`: the limit in s where nobody states one."""
    if options.out is not None:
        files.check_folder(options.out)
    if options.data is not None and not options.data.is_dir():
        raise ArgumentError("--data names no folder", got=str(options.data), expected="a folder that is there")
    stated = [flexlin.scene.parse_assignment(text) for text in options.overrides]
    name_once([key for key, _ in stated])
    asked = {f"accuracy.{key}": getattr(options, name, None) for name, key in ACCURACY.items()}
    overrides = dict(stated) | {key: value for key, value in asked.items() if value is not None}
    scene: Scene = flexlin.load_scene(options.scene, overrides, options.data)
    if usual is not None and "seconds" not in scene.accuracy.model_fields_set:
        scene = scene.model_copy(update={"accuracy": scene.accuracy.model_copy(update={"seconds": usual})})
    keys = list[str]()
    for name in ("over", "vary", "gain", "margins"):
        if getattr(options, name, None):
            setattr(options, name, [read_span(scene, asked) for asked in getattr(options, name)])
            keys += [key for key, *_ in getattr(options, name)]
    name_once(keys)
    send_limits(options.watch.begun, scene.accuracy)
    if options.out is None:
        options.out = Path("out") / Path(options.scene).stem
        files.check_folder(options.out)
    return scene


def name_once(keys: list[str]) -> None:
    """Raises: ArgumentError where a key is there twice: which of its values was meant nobody knows."""
    if len(set(keys)) < len(keys):
        raise ArgumentError("a number is named twice", got=", ".join(keys), expected="each once")


def refuse_existing(path: Path) -> None:
    """Refuse to write a scene over a file; what a killed program left beside it goes.

    Raises: OutputError.
    """
    if path.exists():
        files.clear_left(path)
        todo = "choose another name, or remove it"
        raise OutputError("the scene is there already", got=str(path), expected="a new name", todo=todo)


def meets(required: str | None, verdict: str, model: str) -> bool:
    """Whether a loop with this verdict, in a linear model that is valid, invalid or unknown, is what --require asks for."""
    if required is None:
        return True
    allowed = {"stable": ("valid", "unknown"), "valid": ("valid",), "linear-stable": ("valid", "unknown", "invalid")}
    return verdict == "stable" and model in allowed[required]


def print_paths(paths: list[Path]) -> int:
    """Print where the results are; done."""
    for path in paths:
        print(f"wrote {path}")
    return DONE


def quote(options: argparse.Namespace) -> str:
    """The command line that made a page, without its output folder: what is not as it would be by itself."""
    words = ["flexlin", options.command, options.scene]
    for flag, settings in (OPTIONS[name] for name in options.takes if name not in UNQUOTED):
        value = getattr(options, settings.get("dest", flag.strip("-").replace("-", "_")))
        if value not in (None, False, settings.get("default")):
            each = value if isinstance(value, list) else [] if value is True else [value]
            words += [flag, *map(write_value, each)]
    return shlex.join(words)


def write_value(value: Any) -> str:
    """A value of an option as one would write it."""
    if isinstance(value, tuple):
        key, low, high, number = value
        return f"{key}={low:.15g}:{high:.15g}" + (f":{number}" if number else "")
    return f"{value:.15g}" if isinstance(value, float) else str(value)
