"""Numbers of a scene by dotted path: read, replaced, listed, named with their units, and overridden before the scene is checked."""

import copy
import tomllib
from collections.abc import Container, Iterable, Mapping
from typing import Any

from pydantic import BaseModel

from flexlin.bounds import DEEPEST_NESTING, SHALLOW, hint_at, parse_toml, printable
from flexlin.errors import ArgumentError, Problem
from flexlin.scene.effects import known_effects

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


def need_numbers(scene: BaseModel, paths: Iterable[str]) -> None:
    """Raise for a path that leads to no real number of the scene."""
    for path in paths:
        value = get_value(scene, path)
        if not isinstance(value, float):
            expected = "a real number of the scene, such as motion.frequency or one of a list, effects.payload.mass.0"
            raise ArgumentError(f"{path} cannot be left free", got=repr(value)[:80], expected=expected)


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
    children = list_children(node).items()
    return [path for name, child in children for path in numeric_paths(child, f"{prefix}.{name}" if prefix else name)]


def list_children(node: Any) -> dict[str, Any]:
    """What stands at a node of a scene or of raw data, by the step that a path takes; what is off is left out."""
    if isinstance(node, BaseModel):
        held = {name: getattr(node, name) for name in type(node).model_fields}
        return {name: child for name, child in held.items() if child is not None}
    if isinstance(node, (tuple, list)):
        return {str(i): child for i, child in enumerate(node)}
    return node if isinstance(node, dict) else {}


def _child(node: Any, step: str, path: str) -> Any:
    inside = list_children(node)
    if step in inside:
        return inside[step]
    fields = type(node).model_fields if isinstance(node, BaseModel) else {}
    known, off = [fields[name].alias or name if name in fields else name for name in inside], step in fields
    raise ArgumentError(
        f"the scene has nothing at {path!r}",
        got=repr(step),
        expected=f"one of {', '.join(known)}{hint_at(step, known)}"
        if known
        else "no further step: the path is too long",
        todo=f"switch {step} on: give its whole table, in the scene or with --set" if off else None,
    )


OFF = "off"


def parse_assignment(text: str) -> tuple[str, Any]:
    """Read `key=value`; the value is a TOML value, or else a bare string.

    Raises: ArgumentError when there is no `=` or no key.
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise ArgumentError(
            "an override cannot be read",
            got=printable(repr(text)),
            expected="key=value, such as effects.payload.mass=0.3",
        )
    try:
        return key.strip(), parse_toml(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()
    except RecursionError:
        raise ArgumentError(
            f"the value of {printable(key)} cannot be read", got="tables in tables without end", expected=SHALLOW
        ) from None


def apply_overrides(raw: dict[str, Any], overrides: Mapping[str, Any]) -> tuple[dict[str, Any], list[Problem]]:
    """Return a copy of raw scene data with the overrides in place, and what could not be placed.

    An effect that is off has no table, so its parameters cannot be set: the whole table turns it on, the word "off" turns it off.
    A key that the scene lacks, but its [parameters] table holds, may be written without `parameters.`.
    """
    result, problems = copy.deepcopy(raw), []
    for key, value in overrides.items():
        path = whole_path(key, result, result.get(PARAMETERS)).split(".")
        problem = (
            _place(result, path, value) if len(path) <= DEEPEST_NESTING else (f"a key of {len(path)} steps", SHALLOW)
        )
        if problem:
            problems.append(Problem(printable(key), *problem))
    return result, problems


def _place(tree: Any, path: list[str], value: Any) -> tuple[str, str] | None:
    model = tree.get("model")
    if path[0] == "effects" and model is not None:
        own = tree.get(PARAMETERS)
        keys = ", ".join(map(str, own)) if isinstance(own, dict) else ""
        return f"an effect beside model = {printable(repr(model))}", f"a key of the model's own table: {keys}"
    if path[0] == "links" and "robot" in tree and path[0] not in tree:
        expected = "flexible.NAME with a link's name in that file: flexible.NAME={bending_stiffness=..., modes=...}"
        return "an item of links, which come from the robot's file", expected
    if len(path) > 1 and path[1].isdigit() and path[0] not in tree:
        return (
            f"an item of {printable(path[0])}, which the scene does not have",
            f"a key of the scene: {', '.join(map(str, tree))}",
        )
    for depth, step in enumerate(path[:-1]):
        if path[:1] == ["effects"] and depth == 1 and step not in tree:
            return (
                "a parameter of an effect that is off",
                f"effects.{step} on: set the whole table, effects.{step}={{...}}",
            )
        if isinstance(tree, list) and step not in map(str, range(len(tree))):
            return f"index {step!r}", f"a number from 0 to {len(tree) - 1}"
        tree = tree[int(step)] if isinstance(tree, list) else tree.setdefault(step, {})
        if not isinstance(tree, (dict, list)):
            return f"a key below {'.'.join(path[: depth + 1])}, which is {printable(repr(tree))}", "a key that exists"
    last = path[-1]
    if isinstance(tree, list):
        if last not in map(str, range(len(tree))):
            return f"index {last!r}", f"a number from 0 to {len(tree) - 1}"
        tree[int(last)] = value
    elif path[:1] == ["effects"] and len(path) == 2 and value == OFF:
        known = known_effects()
        if last not in known:
            return "an unknown key", f"one of {', '.join(known)}{hint_at(last, known)}"
        tree.pop(last, None)
    else:
        tree[last] = value
    return None
