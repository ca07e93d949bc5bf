"""The versions of a scene whose equations are a registered model: its own parameters are switched."""

import copy
from collections.abc import Iterator
from functools import partial
from typing import Any

from pydantic import BaseModel, ValidationError

from flexlin.answers.audit.versions import MOST_MODES, Version
from flexlin.scene.base import Table
from flexlin.scene.library import registered_model
from flexlin.scene.scene import Scene

MODES = "modes"
"""A key of a model's table that means what it means in a scene: the modes of a link."""

Path = tuple[str | int, ...]


def list_model_versions(scene: Scene) -> Iterator[Version]:
    """Set each number of the model's table to zero that may be zero, change each number of modes by one.

    What the model's schema refuses is not tried. A model says nothing of effects that it leaves out, so none is added.
    """
    if scene.model is None:
        return
    schema = registered_model(scene.model).schema
    for version in (*list_switches(scene, schema), *list_mode_steps(scene)):
        if accepts(schema, version.make(scene).parameters):
            yield version


def list_switches(scene: Scene, schema: type[BaseModel]) -> Iterator[Version]:
    """Each number of the model's table taken away."""
    units = schema.units() if issubclass(schema, Table) else {}
    for name, field in schema.model_fields.items():
        value = scene.parameters.get(name, field.default)
        if isinstance(value, int | float) and not isinstance(value, bool) and value != 0:
            switch = partial(with_parameter, path=(name,), value=0.0)
            yield Version(switch, f"without {name}", "effect", name, True, {name: float(value)}, units)


def list_mode_steps(scene: Scene) -> Iterator[Version]:
    """Each number of modes in the model's table one less and one more."""
    for path, modes in find_modes(scene.parameters):
        where = ".".join(map(str, path[:-1]))
        for step in (-1, 1):
            if 0 <= modes + step <= MOST_MODES:
                change = f"{where} with {modes + step} mode{'s' if modes + step != 1 else ''}"
                give = partial(with_more, path=path, step=step)
                yield Version(give, change, "modes", where, step < 0, {"modes": modes + step})


def find_modes(node: Any, path: Path = ()) -> Iterator[tuple[Path, int]]:
    """Every whole number under a key `modes`, with its path."""
    children = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list | tuple) else ()
    for key, child in children:
        if key == MODES and isinstance(child, int) and not isinstance(child, bool):
            yield (*path, key), child
        else:
            yield from find_modes(child, (*path, key))


def with_parameter(scene: Scene, path: Path, value: Any) -> Scene:
    """The scene with another value in the model's table."""
    table = copy.deepcopy(scene.parameters)
    node: Any = table
    for step in path[:-1]:
        node = node[step]
    node[path[-1]] = value
    return scene.model_copy(update={"parameters": table})


def with_more(scene: Scene, path: Path, step: int) -> Scene:
    """The scene with a number of the model's table changed by a step."""
    value: Any = scene.parameters
    for key in path:
        value = value[key]
    return with_parameter(scene, path, value + step)


def accepts(schema: type[BaseModel], table: dict[str, Any]) -> bool:
    """Whether a model takes a table."""
    try:
        schema.model_validate(table)
    except ValidationError:
        return False
    return True
