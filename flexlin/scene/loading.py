"""From a TOML file or a built-in name to a checked scene."""

import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from flexlin import bounds
from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.errors import Problem, SceneError
from flexlin.scene.base import Table
from flexlin.scene.consistency import contradictions, tables_in
from flexlin.scene.library import builtin_scenes, place_motion_file, registered_model
from flexlin.scene.links import expand_sections
from flexlin.scene.motion import AnyMotion
from flexlin.scene.parameters import PARAMETERS, apply_overrides, get_value, need_numbers, path_in, replace_value
from flexlin.scene.problems import checked_table, schema_problems
from flexlin.scene.scene import Scene, uncertainty_problems


@checked
def load_scene(
    source: str | Path, overrides: Mapping[str, Any] | None = None, data_folder: str | Path | None = None
) -> Scene:
    """Load a scene by its built-in name or from a TOML file.

    Parameters
    ----------
    source : str or Path
        A name that `builtin_scenes` lists, or a path.
    overrides : mapping of str to value, optional
        Dotted paths and what stands there instead, such as {"effects.payload.mass": 0.3}; what stands in a registered model's
        [parameters] also without `parameters.`.
    data_folder : str or Path, optional
        A folder beside the scene's own whose files the scene may name.

    Returns
    -------
    Scene
        A frozen, checked scene.

    Raises
    ------
    SceneError
        With all problems at once, each with its key, what was got and what was expected.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link", {"effects.payload.mass": 0.1})
    >>> scene.title, scene.effects.payload.mass
    ('Single-link flexible manipulator', 0.1)
    """
    path = _find(source)
    return parse_scene(_read(path), str(source), overrides, path.parent, data_folder)


@checked
def parse_scene(
    raw: Mapping[str, Any],
    source: str = "scene",
    overrides: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    data_folder: str | Path | None = None,
) -> Scene:
    """Check a scene that is given as plain data.

    Parameters
    ----------
    raw : mapping
        The tables of the scene, as TOML gives them.
    source : str
        Name of the scene in messages.
    overrides : mapping of str to value, optional
        Dotted paths and what stands there instead.
    folder : str or Path, optional
        The scene's own folder, by default the one that you work in: files that the scene names must lie below it.
    data_folder : str or Path, optional
        Another folder whose files the scene may name.

    Returns
    -------
    Scene
        A frozen, checked scene.

    Raises
    ------
    SceneError
        With all problems at once.

    Examples
    --------
    >>> import flexlin as fl
    >>> raw = {
    ...     "schema": 1,
    ...     "title": "A stiff link",
    ...     "links": [{"length": 1.0, "mass_per_length": 2.0, "modes": 0}],
    ...     "motion": {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.3}]},
    ... }
    >>> fl.parse_scene(raw).motion.frequency
    0.5
    """
    source, data, changes = bounds.printable(source), as_python(raw), as_python(overrides or {})
    beyond = [*bounds.list_excesses(data), *bounds.list_excesses(changes)]
    if beyond:
        raise SceneError(source, [Problem(bounds.printable(path), *said) for path, *said in beyond])
    data, problems = apply_overrides(data, changes)
    folders = [Path(one) for one in (folder or Path(), data_folder) if one is not None]
    if set(Scene.read_before) & set(data):
        from flexlin.scene.urdf.tables import expand_robot  # a scene without a robot is read without it

        problems += expand_robot(data, folders)
    problems += [*expand_sections(data), *place_motion_file(data, folders)]
    try:
        scene = Scene.model_validate(data, context={"sliding": all_slide(data.get("links"))})
        problems += uncertainty_problems(scene)
    except ValidationError as error:
        problems += schema_problems(Scene, error)
    problems += [
        problem for problem in contradictions(data) if not any(_explains(known, problem) for known in problems)
    ]
    if problems:
        raise SceneError(source, problems)
    return scene


def as_python(raw: Any, depth: int = bounds.DEEPEST_NESTING + 1) -> Any:
    """Plain data whose NumPy numbers and arrays are Python's own; what lies deeper than data may is left."""
    if isinstance(raw, np.generic | np.ndarray):
        return raw.tolist()
    if isinstance(raw, Mapping) and depth:
        return {key: as_python(value, depth - 1) for key, value in raw.items()}
    if isinstance(raw, list | tuple) and depth:
        return [as_python(value, depth - 1) for value in raw]
    return raw


def all_slide(links: Any) -> bool | None:
    """Whether all joints of raw links slide that move; None where some do and others do not."""
    kinds = {link.get("joint") == "prismatic" for link in tables_in(links) if link.get("joint") != "fixed"}
    return None if len(kinds) > 1 else True in kinds


class OnlyMotion(Table):
    """A table that holds a motion alone."""

    motion: AnyMotion


def read_motion(raw: Mapping[str, Any], sliding: bool | None = False) -> AnyMotion:
    """Check a motion that is given as plain data; `sliding` as in `all_slide`. Raises: SceneError with all problems at once."""
    data = {"motion": as_python(raw)}
    problems = [Problem(bounds.printable(path), *said) for path, *said in bounds.list_excesses(data)]
    problems = problems or place_motion_file(data, [Path()])
    if not problems:
        try:
            return OnlyMotion.model_validate(data, context={"sliding": sliding}).motion
        except ValidationError as error:
            problems = schema_problems(OnlyMotion, error)
    raise SceneError("motion", problems)


def scene_text(source: str | Path) -> str:
    """The text of a built-in scene or of a TOML file, as it stands there.

    Raises: SceneError when there is no such scene, or its file cannot be read.
    """
    return _read_text(_find(source))


def _read_text(path: Path) -> str:
    try:
        return bounds.read_text(path, bounds.LARGEST_SCENE)
    except OSError as error:
        got = bounds.printable(error.strerror or error)
        raise SceneError(bounds.printable(path), [Problem("file", got, "a TOML file in UTF-8")]) from None


def _explains(known: Problem, other: Problem) -> bool:
    """Whether a problem is already listed, or only follows from one that leaves the number of coordinates unknown."""
    if known.key == other.key or known.key.startswith(f"{other.key}."):
        return True
    counted = known.key.startswith(("links", "motion")) and known.key.rsplit(".", 1)[-1].isdigit()
    counted |= known.key.rsplit(".", 1)[-1] in ("modes", "drive", "joints", "links")
    return counted and other.key.startswith(("control.", "designs."))


def _find(source: str | Path) -> Path:
    scenes, name = builtin_scenes(), str(source)
    if name in scenes:
        return scenes[name]
    path, got = Path(name), "no such file or built-in scene" if name.strip() else "an empty name"
    with suppress(OSError):  # the name is too long, or its folder may not be searched
        if name.strip() and path.exists():
            if not path.is_dir():
                return path
            got = "a folder"
    expected = f"a TOML file, or one of {', '.join(sorted(scenes))}{bounds.hint_at(name, scenes)}"
    raise SceneError(bounds.printable(name).strip() or "scene", [Problem("file", got, expected)])


def _read(path: Path) -> dict[str, Any]:
    text = _read_text(path)
    try:
        return bounds.parse_toml(text)
    except RecursionError:
        raise SceneError(
            bounds.printable(path), [Problem("file", "tables in tables without end", bounds.SHALLOW)]
        ) from None
    except tomllib.TOMLDecodeError as error:
        got, expected = explain_fault(text, error)
        raise SceneError(bounds.printable(path), [Problem("file", bounds.printable(got), expected)]) from None


FAULTS = {
    "Illegal character '\\n'": "a closing quote",
    "Unterminated string": "a closing quote",
    'Expected "\'"': "a closing quote",
    "Invalid value": "a number, a text in quotes, true, false, [ ] or { } behind =",
    "Expected newline": "the end of the line behind one value; texts stand in quotes",
    "Expected '='": "key = value",
    "Expected ']": "a closing bracket",
    "Unclosed array": "a comma, or a closing bracket before it",
    "Unclosed inline table": "a comma, or a closing brace on the same line",
    "Cannot overwrite": "each key once",
    "Cannot declare": "each table once",
}
"""What is missing where Python's reader of TOML says so."""


def explain_fault(text: str, error: tomllib.TOMLDecodeError) -> tuple[str, str]:
    """Of a text that is no TOML: the line at fault, and what was expected there."""
    said, lines = str(error), text.splitlines() or [""]
    place = re.search(r"\(at line (\d+), column \d+\)$", said)
    if place is None and "end of document" not in said:
        return said, "a readable TOML file"
    number = min(int(place[1]), len(lines)) if place else len(lines)
    expected = next(
        (words for start, words in FAULTS.items() if said.startswith(start)), f"TOML: {said.partition(' (')[0]}"
    )
    return f"{lines[number - 1].strip()} in line {number}", expected


@checked
def scene_from_urdf(path: str | Path, base: str | None = None, tip: str | None = None) -> Scene:
    """Make a scene of a chain of a robot from its URDF file.

    Joints, axes, origins, inertias, damping, friction and mimicked joints are read; fixed joints are merged, links that hang on the chain
    by fixed joints are added to it, and the arm ends at the tip's frame. Gravity points along -z of the base. Limits of torque and speed
    become those of the drives, where every joint has them. Each joint stands still, at 0 or in the middle of its limits where these
    leave 0 out; give the scene a motion.

    Parameters
    ----------
    path : str or Path
        The file; no mesh and no other file is read.
    base, tip : str, optional
        Names of the first and the last link; by default the root, and the only end of the tree behind a joint that moves.

    Returns
    -------
    Scene
        A frozen, checked scene; its `source` says what was read and what not.

    Raises
    ------
    SceneError
        Naming the line where the file is at fault.

    Examples
    --------
    >>> import flexlin as fl
    >>> from flexlin.scene.library import models_folder
    >>> scene = fl.scene_from_urdf(models_folder() / "manutec-r3.urdf")
    >>> len(scene.links), scene.links[1].name
    (6, 'axis_2')
    """
    from flexlin.scene.urdf.convert import scene_tables
    from flexlin.scene.urdf.robot import read_robot

    robot = read_robot(path)
    return parse_scene(scene_tables(robot, base, tip), str(path))


def raw_tables(scene: Scene) -> dict[str, Any]:
    """The scene as plain data, only what was written into it: `parse_scene` makes the same scene of it."""
    return scene.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True, warnings=False)


def revise_scene(scene: Scene, values: Mapping[str, float]) -> Scene:
    """The scene with other numbers at dotted paths.

    Raises: SceneError with the key of each number that is refused, a registered model's own too; ArgumentError for a path to nothing.
    """
    changed = scene
    for path, value in values.items():
        get_value(scene, path)  # which names the whole path where nothing stands
        changed = replace_value(changed, path_in(scene, path), value)
    revised = parse_scene(raw_tables(changed), scene.title)
    if revised.model is not None:
        checked_table(registered_model(revised.model).schema, revised.parameters, scene.title, PARAMETERS)
    return revised


MOST_CORNERS = 6
"""Paths of a grid whose corners are checked together."""


def check_axes(scene: Scene, axes: Mapping[str, Array], grid: bool) -> None:
    """Refuse values that the scene's schema refuses, each path by itself and the corners of a grid together, before any computation.

    Of the values those are checked that an interval, perhaps without zero, refuses: the ends first. Raises: SceneError with the key.
    """
    need_numbers(scene, (path for path in axes if not path_in(scene, path).startswith(PARAMETERS)))
    for path, values in axes.items():
        get_value(scene, path)
        nearest = values[np.abs(np.where(values, values, np.inf)).argmin()]
        zero = values[values == 0][:1]
        for value in dict.fromkeys([values.min(), values.max(), *zero, nearest]):
            revise_scene(scene, {path: float(value)})
    if grid and 1 < len(axes) <= MOST_CORNERS:
        for corner in product(*[(float(axis.min()), float(axis.max())) for axis in axes.values()]):
            revise_scene(scene, dict(zip(axes, corner, strict=True)))
