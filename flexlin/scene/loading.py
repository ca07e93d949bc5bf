"""From a TOML file or a built-in name to a checked scene."""

import difflib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from flexlin.errors import Problem, SceneError
from flexlin.scene.consistency import contradictions
from flexlin.scene.library import builtin_scenes
from flexlin.scene.overrides import apply_overrides
from flexlin.scene.scene import Scene

AnyTable = TypeVar("AnyTable", bound=BaseModel)


def load_scene(source: str | Path, overrides: Mapping[str, Any] | None = None) -> Scene:
    """Load a scene by its built-in name or from a TOML file, with dotted overrides.

    Parameters: source: a name that `builtin_scenes` lists, or a path; overrides: {"effects.payload.mass": 0.3}.
    Returns: a frozen, checked `Scene`.
    Raises: SceneError with all problems at once, each with its key, what was got and what was expected.
    """
    path = _find(source)
    return parse_scene(_read(path), str(path), overrides, path.parent)


def parse_scene(
    raw: Mapping[str, Any],
    source: str = "scene",
    overrides: Mapping[str, Any] | None = None,
    folder: Path | None = None,
) -> Scene:
    """Check raw scene data; relative file names in it are meant from `folder`."""
    data, problems = apply_overrides(dict(raw), overrides or {})
    motion = data.get("motion")
    if folder is not None and isinstance(motion, dict) and isinstance(motion.get("file"), str):
        motion["file"] = str((folder / motion["file"]).resolve())
    try:
        scene = Scene.model_validate(data)
    except ValidationError as error:
        problems += [_problem(entry) for entry in error.errors(include_url=False)]
    named = {problem.key for problem in problems}
    problems += [problem for problem in contradictions(data) if problem.key not in named]
    if problems:
        raise SceneError(source, problems)
    return scene


def checked_table(schema: type[AnyTable], raw: Mapping[str, Any], source: str, key: str) -> AnyTable:
    """Check one raw table by its schema; raises SceneError with all problems, their keys below `key`."""
    try:
        return schema.model_validate(dict(raw))
    except ValidationError as error:
        problems = [_problem(entry) for entry in error.errors(include_url=False)]
        raise SceneError(source, [Problem(f"{key}.{p.key}", p.got, p.expected) for p in problems]) from None


def _find(source: str | Path) -> Path:
    scenes = builtin_scenes()
    if str(source) in scenes:
        return scenes[str(source)]
    path = Path(source)
    if path.is_file():
        return path
    close = difflib.get_close_matches(str(source), scenes, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    expected = f"a TOML file, or one of {', '.join(sorted(scenes))}{hint}"
    raise SceneError(str(source), [Problem("file", "no such file or built-in scene", expected)])


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise SceneError(str(path), [Problem("file", str(error), "a readable TOML file")]) from None


def _problem(entry: Any) -> Problem:
    """Say a pydantic error as key, got, expected."""
    key = ".".join(str(step) for step in entry["loc"] if not _is_type_name(step)) or "scene"
    if entry["type"] == "extra_forbidden":
        return Problem(key, "an unknown key", "only keys of the scene format")
    got = "nothing" if entry["type"] == "missing" else repr(entry["input"])[:60]
    return Problem(key, got, entry["msg"].removeprefix("Input should be ").removeprefix("Value error, "))


def _is_type_name(step: object) -> bool:
    """Whether a step of pydantic's location names a branch of a union, not a key of the file."""
    names = ("harmonic", "rotation", "fourier", "point-to-point", "table", "float", "constrained-float")
    return isinstance(step, str) and (step in names or "[" in step)
