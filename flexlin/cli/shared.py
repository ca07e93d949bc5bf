"""What the commands share: reading the scene, its clock, writing the results, exit codes, the command line as a page quotes it."""

import argparse
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexlin.cli.options import OPTIONS
from flexlin.errors import OutputError

if TYPE_CHECKING:
    import xarray

    from flexlin.answers.clock import Clock
    from flexlin.report.figures.style import Picture
    from flexlin.scene.scene import Scene

DONE, FAILED, BAD_INPUT, OTHER_VERDICT, NO_ANSWER = range(5)
"""Exit codes."""
LONG = 600.0
"""Limit in s of a search or a fit where nobody states one."""
ACCURACY = {"tol": "tol", "limit_seconds": "seconds", "limit_memory": "memory"}
"""Options that stand for a key of the scene's table [accuracy]."""
UNQUOTED = ("scene", "out", "require", "workers", "scheduler")
"""Options that change where results go and who computes them, but not what they are; the scene is said first."""


@dataclass(frozen=True)
class Command:
    """A row of the table of commands: reads the options that it takes, calls the library, prints and writes; returns the exit code."""

    name: str
    purpose: str
    takes: tuple[str, ...]
    run: Callable[[argparse.Namespace], int]


def command(name: str, purpose: str, *takes: str) -> Callable[[Callable[[argparse.Namespace], int]], Command]:
    """Make a function the command of this name."""
    return lambda run: Command(name, purpose, takes, run)


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
        from flexlin.report.progress import Progress

        with Progress() as self.progress:
            self.progress("load the numerical libraries")
            from flexlin.answers.clock import Budget, Clock

            self.kept = Clock(self.progress, planned=planned, budget=Budget(self.options.watch))
            yield self.kept

    def say_accuracy(self) -> None:
        """Print what was asked, reached and taken."""
        from flexlin.report.terminal import accuracy_lines

        print("\n".join(accuracy_lines(tuple(self.kept.steps))))

    def page(self, pictures: "Sequence[Picture]", said: Sequence[str] = ()) -> str:
        """A page of pictures, below what is to be said before them."""
        from flexlin.report.page import picture_page

        return picture_page(self.scene.title, pictures[0], self.quoted, pictures[1:], said)

    def write(
        self,
        name: str,
        pictures: "Sequence[Picture]",
        record: Mapping[str, Any],
        said: Sequence[str] = (),
        more: Mapping[str, str] | None = None,
    ) -> int:
        """Write NAME.html with the pictures, NAME.json with the numbers, and more files of text; done."""
        from flexlin.report.numbers import to_json

        data = to_json({"schema": 1, "title": self.scene.title, **record})
        texts = {f"{name}.html": self.page(pictures, said), f"{name}.json": data, **(more or {})}
        return print_paths(self.write_files(name, texts))

    def write_files(self, name: str, texts: Mapping[str, str], data: "xarray.Dataset | None" = None) -> list[Path]:
        """Write files of text, and a dataset as NAME.nc, as one set; returns where they are."""
        from flexlin.files import results
        from flexlin.report.exports import write_dataset

        with results(self.options.out, name) as made:
            for file, text in texts.items():
                (made / file).write_text(text, encoding="utf-8")
            return made.placed(*texts) + ([] if data is None else write_dataset(data, made, name))


def loaded(options: argparse.Namespace, usual: float | None = None) -> "Scene":
    """The scene with its overrides, once the output folder has been found usable; `usual`: the limit in s where nobody states one."""
    from flexlin.cli.supervised import send_limits
    from flexlin.files import check_folder
    from flexlin.scene.loading import load_scene
    from flexlin.scene.parameters import parse_assignment

    if options.out is not None:
        check_folder(options.out)
    overrides = dict(parse_assignment(text) for text in options.overrides)
    asked = {f"accuracy.{key}": getattr(options, name, None) for name, key in ACCURACY.items()}
    overrides |= {key: value for key, value in asked.items() if value is not None}
    scene = load_scene(options.scene, overrides, options.data)
    if usual is not None and "seconds" not in scene.accuracy.model_fields_set:
        scene = scene.model_copy(update={"accuracy": scene.accuracy.model_copy(update={"seconds": usual})})
    send_limits(options.watch.begun, scene.accuracy)
    if options.out is None:
        options.out = Path("out") / Path(options.scene).stem
        check_folder(options.out)
    return scene


def refuse_existing(path: Path) -> None:
    """Refuse to write a scene over a file; what a killed program left beside it goes.

    Raises: OutputError.
    """
    from flexlin.files import clear_left

    if path.exists():
        clear_left(path)
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
    for flags, settings in (OPTIONS[name] for name in options.takes if name not in UNQUOTED):
        value = getattr(options, settings.get("dest", flags[0].strip("-").replace("-", "_")))
        if value not in (None, False, settings.get("default")):
            each = value if isinstance(value, list) else [] if value is True else [value]
            words += [flags[0], *map(write_value, each)]
    return shlex.join(words)


def write_value(value: Any) -> str:
    """A value of an option as one would write it."""
    if isinstance(value, tuple):
        key, low, high, number = value
        return f"{key}={low:g}:{high:g}" + (f":{number}" if number else "")
    return f"{value:g}" if isinstance(value, float) else str(value)
