"""What the commands share: reading the scene with its overrides, exit codes, the command line as a page quotes it."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from flexlin.errors import OutputError

if TYPE_CHECKING:
    from flexlin.scene.scene import Scene

DONE, FAILED, BAD_INPUT, OTHER_VERDICT, NO_ANSWER = range(5)
"""Exit codes."""
ACCURACY = {"tol": "tol", "limit_seconds": "seconds", "limit_memory": "memory"}
"""Options that stand for a key of the scene's table [accuracy]."""


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


def command(options: argparse.Namespace) -> str:
    """The command line that made a page, without its output folder."""
    overrides = [word for text in options.overrides for word in ("--set", text)]
    axes = [
        f"{key}={low:g}:{high:g}" + (f":{number}" if number else "")
        for key, low, high, number in getattr(options, "over", [])
    ]
    over = ["--over", *axes] if axes else []
    ranges = [f"{key}={low:g}:{high:g}" for key, low, high, _ in getattr(options, "margins", [])]
    over += ["--margins", *ranges] if ranges else []
    over += ["--data", str(options.data)] if getattr(options, "data", None) else []
    flags = [
        f"--{name}"
        for name in ("effects", "sensitivity", "loop-margins", "animate")
        if getattr(options, name.replace("-", "_"), False)
    ]
    forward = getattr(options, "feedforward", "scene")
    flags += [] if forward == "scene" else ["--feedforward", forward]
    for name in ("step", "initial", "push", "noise"):
        words = getattr(options, name, None)
        flags += [] if words is None else [f"--{name}", words]
    flags += ["--loop", options.of] if getattr(options, "of", "own") != "own" else []
    flags += ["--log", str(options.log)] if getattr(options, "log", None) else []
    flags += ["--free", *options.free] if getattr(options, "free", None) else []
    flags += ["--window", f"{options.window:g}"] if getattr(options, "window", 2.0) != 2.0 else []
    for name in ACCURACY:
        value = getattr(options, name, None)
        flags += [] if value is None else [f"--{name.replace('_', '-')}", f"{value:g}"]
    return shlex.join(["flexlin", options.command, options.scene, *overrides, *over, *flags])
