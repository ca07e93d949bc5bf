"""Dotted overrides: `effects.payload.mass=0.3` on the command line, {"effects.payload.mass": 0.3} in Python."""

import copy
import tomllib
from collections.abc import Mapping
from typing import Any

from flexlin.errors import ArgumentError, Problem
from flexlin.scene.effects import known_effects
from flexlin.scene.parameters import PARAMETERS, whole_path
from flexlin.scene.toml import DEEPEST, parse_toml
from flexlin.text import hint_at, printable

OFF = "off"
MOST = 4
"""Keys that a message names."""
SHALLOW = f"at most {DEEPEST} tables and lists in each other"


def too_deep(raw: Any) -> bool:
    """Whether raw data hold more than `DEEPEST` tables and lists in each other; looks no further than that."""
    level = [raw]
    for _ in range(DEEPEST):
        inner = (node.values() if isinstance(node, dict) else node for node in level)
        level = [child for nodes in inner for child in nodes if isinstance(child, (dict, list, tuple))]
        if not level:
            return False
    return True


def _too_deep(steps: int) -> tuple[str, str]:
    return f"a key of {steps} steps", SHALLOW


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
        problem = _place(result, path, value) if len(path) <= DEEPEST else _too_deep(len(path))
        if problem:
            problems.append(Problem(printable(key), *problem))
    return result, problems


def _list_keys(raw: dict[str, Any], last: str) -> str:
    """The dotted paths of raw data that end like a key, in words: a model keeps its links below `parameters`."""
    level: list[tuple[str, Any]] = [("", raw)]
    found = list[str]()
    while level:
        path, node = level.pop(0)
        items = node.items() if isinstance(node, dict) else enumerate(node)
        for step, child in items:
            whole = f"{path}.{step}" if path else str(step)
            found += [whole] if step == last else []
            level += [(whole, child)] if isinstance(child, (dict, list)) else []
    return f"a key of the scene, such as {' or '.join(found[:MOST])}" if found else "a key of the scene"


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
        return f"an item of {printable(path[0])}, which the scene does not have", _list_keys(tree, path[-1])
    for depth, step in enumerate(path[:-1]):
        if path[:1] == ["effects"] and depth == 1 and step not in tree:
            return (
                "a parameter of an effect that is off",
                f"effects.{step} on: set the whole table, effects.{step}={{...}}",
            )
        try:
            tree = tree[int(step)] if isinstance(tree, list) else tree.setdefault(step, {})
        except (ValueError, IndexError):
            return f"index {step!r}", f"a number from 0 to {len(tree) - 1}"
        if not isinstance(tree, (dict, list)):
            return f"a key below {'.'.join(path[: depth + 1])}, which is {printable(repr(tree))}", "a key that exists"
    last = path[-1]
    if isinstance(tree, list):
        if not last.isdigit() or int(last) >= len(tree):
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
