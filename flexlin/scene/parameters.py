"""Numbers of a scene by dotted path: read them, replace them, list them."""

from collections.abc import Container
from typing import Any

from pydantic import BaseModel

from flexlin.errors import ArgumentError

PARAMETERS = "parameters"
"""Key of the table of a registered model."""


def whole_path(path: str, keys: Container[str], parameters: Any) -> str:
    """The path from the scene's own keys on: a key that the scene lacks, but its [parameters] table holds, may be written without
    `parameters.`.

    Parameters: keys: those that the scene has; parameters: the registered model's own table.
    """
    step = path.split(".", 1)[0]
    held = step not in keys and isinstance(parameters, dict) and step in parameters
    return f"{PARAMETERS}.{path}" if held else path


def path_in(scene: BaseModel, path: str) -> str:
    """The `whole_path` in a checked scene."""
    return whole_path(path, scene.model_fields_set, getattr(scene, PARAMETERS, None))


def get_value(scene: BaseModel, path: str) -> Any:
    """Read what stands at a dotted path, such as `effects.payload.mass` or `links.0.length`; of a registered model's table also
    without `parameters.`.

    Raises: ArgumentError when nothing stands there.
    """
    node: Any = scene
    for step in path_in(scene, path).split("."):
        node = _child(node, step, path)
    return node


def replace_value(node: Any, path: str, value: Any) -> Any:
    """Return a copy with another value at a dotted path.

    The value is not checked: it may be a CasADi symbol, which then flows into the expressions as the number would.
    """
    step, _, rest = path.partition(".")
    child = _child(node, step, path)
    new = replace_value(child, rest, value) if rest else value
    if isinstance(node, (tuple, list)):
        i = int(step)
        return (*node[:i], new, *node[i + 1 :])
    if isinstance(node, dict):
        return {**node, step: new}
    return node.model_copy(update={step: new})


def numeric_paths(node: Any, prefix: str = "") -> list[str]:
    """List the dotted paths of all real numbers (not counts) below a table."""
    if isinstance(node, float):
        return [prefix]
    if isinstance(node, BaseModel):
        children = [(name, getattr(node, name)) for name in type(node).model_fields]
    elif isinstance(node, (tuple, list)):
        children = [(str(i), child) for i, child in enumerate(node)]
    elif isinstance(node, dict):
        children = list(node.items())
    else:
        return []
    return [path for name, child in children for path in numeric_paths(child, f"{prefix}.{name}" if prefix else name)]


def _child(node: Any, step: str, path: str) -> Any:
    try:
        if isinstance(node, (tuple, list)):
            return node[int(step)]
        if isinstance(node, dict):
            return node[step]
        if isinstance(node, BaseModel) and step in type(node).model_fields and getattr(node, step) is not None:
            return getattr(node, step)
    except (IndexError, KeyError, ValueError):
        pass
    off = isinstance(node, BaseModel) and step in type(node).model_fields
    raise ArgumentError(
        f"the scene has nothing at {path!r}",
        got=step,
        expected=f"one of {', '.join(_names(node)) or 'none: the path is too long'}",
        todo=f"switch {step} on: give its whole table, in the scene or with --set" if off else None,
    )


def _names(node: Any) -> list[str]:
    """What a path may go on with at a table of the scene."""
    if isinstance(node, (tuple, list)):
        return [str(i) for i in range(len(node))]
    if isinstance(node, dict):
        return list(node)
    fields = type(node).model_fields if isinstance(node, BaseModel) else ()
    return [name for name in fields if getattr(node, name) is not None]
