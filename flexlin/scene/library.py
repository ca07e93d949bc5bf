"""The scenes and hand-written models that travel with flexlin, and where the files lie that a scene names."""

import importlib.util
import sys
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from flexlin.bounds import printable
from flexlin.errors import Problem, SceneError


def models_folder() -> Path:
    """The folder of built-in scenes: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def builtin_scenes() -> dict[str, Path]:
    """Return the built-in scenes by name.

    Returns
    -------
    dict of str to Path
        The scene files.

    Examples
    --------
    >>> from flexlin.scene import builtin_scenes
    >>> "single-link" in builtin_scenes()
    True
    """
    return {path.stem: path for path in sorted(models_folder().glob("*.toml"))}


def scenes() -> dict[str, str]:
    """Return the titles of the built-in scenes by name, which `load_scene` takes.

    Returns
    -------
    dict of str to str
        Title by name.

    Examples
    --------
    >>> import flexlin as fl
    >>> fl.scenes()["khang-2019"]
    'Single-link manipulator of Khang, Dat, Tuan (2019)'
    """
    return {
        name: str(tomllib.loads(path.read_text(encoding="utf-8"))["title"]) for name, path in builtin_scenes().items()
    }


@dataclass(frozen=True)
class RegisteredModel:
    """A model written in Python: `schema` checks the scene's parameters table, `build` makes the manipulator from it."""

    schema: type[BaseModel]
    build: Callable[..., Any]


_REGISTRY: dict[str, RegisteredModel] = {}


def register_model(name: str, schema: type[BaseModel], build: Callable[..., Any]) -> None:
    """Let scenes say `model = name` for equations that are written in Python.

    Parameters
    ----------
    name : str
        Name of the model.
    schema : type of pydantic.BaseModel
        Checks the scene's `parameters` table.
    build : callable
        Checked parameters -> Manipulator.

    Examples
    --------
    >>> import casadi as ca
    >>> from pydantic import BaseModel
    >>> import flexlin as fl
    >>> from flexlin.scene import register_model
    >>> class Pendulum(BaseModel):
    ...     length: float
    >>> def build(table):
    ...     q, rate = ca.SX.sym("q"), ca.SX.sym("rate")
    ...     return fl.Manipulator.from_lagrangian(q, rate, (table.length * rate) ** 2 / 2, -9.81 * table.length * ca.cos(q))
    >>> register_model("pendulum", Pendulum, build)
    >>> motion = {"kind": "harmonic", "frequency": 0.5, "joints": [{"amplitude": 0.3}]}
    >>> raw = {"schema": 1, "title": "A pendulum", "model": "pendulum", "parameters": {"length": 0.5}, "motion": motion}
    >>> fl.build_manipulator(fl.parse_scene(raw)).M
    SX(0.25)
    """
    _REGISTRY[name] = RegisteredModel(schema, build)


def registered_model(name: str) -> RegisteredModel:
    """Find a model that Python code has registered; the shipped ones are registered on first use.

    Raises: SceneError when no code has registered that name.
    """
    found = _REGISTRY.get(name) or shipped_models().get(name)
    if found is None:
        expected = f"a registered model, one of {', '.join(sorted(_REGISTRY))}; flexlin.scene.register_model adds one from Python"
        raise SceneError("scene", [Problem("model", repr(name), expected)])
    return found


def shipped_models() -> dict[str, RegisteredModel]:
    """The models that flexlin ships, and whatever Python code has registered beside them.

    The files that flexlin itself ships are run: each calls `register_model`. No name from a scene is ever imported.
    """
    for path in sorted(models_folder().glob("*.py")):
        spec = importlib.util.spec_from_file_location(f"flexlin_models.{path.stem}", path)
        if spec is not None and spec.loader is not None:
            sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)  # where `inspect` looks for sources
            spec.loader.exec_module(module)
    return dict(_REGISTRY)


def place_motion_file(data: dict[str, Any], folders: Sequence[Path]) -> list[Problem]:
    """Make the name of the motion's file absolute: the first of the folders that has it.

    A name that leads out of all of them, by .. or by a link, is a problem, whether there is such a file or not.
    """
    motion = data.get("motion")
    if not isinstance(motion, dict) or not isinstance(motion.get("file"), str):
        return []
    found = place_below(motion["file"], folders)
    if found is None:
        expected = "a file below the scene's folder, or below a folder that you name (--data DIR)"
        return [Problem("motion.file", printable(repr(motion["file"])), expected)]
    motion["file"] = str(found)
    return []


def place_below(name: str, folders: Sequence[Path]) -> Path | None:
    """The place of a file below the first of the folders that has it, links followed, or below the first of them all.

    None where the name leads out of all of them, or is none that a file can have.
    """
    try:
        places = [(folder.resolve(), (folder / name).resolve()) for folder in folders]
        below = [path for folder, path in places if folder in path.parents]
        return next((path for path in below if path.exists()), below[0] if below else None)
    except (OSError, ValueError, RuntimeError):  # a null character, a loop of links
        return None
