"""Scenes that nobody wrote: drawn from the JSON schema, or built-in ones with some places changed, as TOML."""

import json
import math
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from hypothesis import strategies as st

from flexlin import Scene
from flexlin.scene import effects_table
from tests.torture.bases import BASES, FILES, Raw


class Bare(str):
    """A word of TOML that stands as it is."""

    __slots__ = ()


def nest(depth: int, inner: Any) -> Any:
    """Tables in tables."""
    for _ in range(depth):
        inner = {"a": inner}
    return inner


EXTREME = (
    0, -0.0, 1, -1, 5e-324, 1e-300, 1e-31, 1e-12, 1e12, 1e30, 1e31, 1e308, -1e308, math.inf, -math.inf, math.nan, 2**63, -(2**70),
)  # fmt: skip
TEXTS = (
    *("", " ", "x" * 5000, "\x1b[2Jfree", "a\0b", "\u202egnp", "<script>alert(1)</script>", "../../../etc/passwd"),
    *("/dev/zero", "%s{0}", "'\";--", "\u03a9\U0001f9be\ufb01\u0301 \u05d0\u0627", "1e3 mm", "-5 deg/s", "1e999 N m"),
    *("folder.csv", *FILES),
)
NONSENSE = (
    *(*EXTREME, *TEXTS, True, [], {}, [[]], [{}], [1.0] * 300, [math.nan], {"": {}}, {"kind": "pd"}, ["a", 1, None]),
    *({"a": {"b": {"c": [1]}}}, [1.0] * 20_000, [[0.0] * 6] * 6, nest(60, 1.0), 10**40),
    *({"y": 1, "z": 1, "torsion": 10**6}, {"joints": "1 rad", "input": "0 N m"}),
    *map(Bare, ("1979-05-27T07:32:00Z", "12:00:00", "0xffffffffffffffffffff", "1e999", "-nan", "1_000.5", "0b1")),
)
"""What stands where something else should; None is left out, since TOML has no such thing."""
DEEPEST = 6


def schema() -> Raw:
    """The JSON schema of a scene, with the tables of all effects."""
    whole, effects = Scene.model_json_schema(), effects_table().model_json_schema()
    definitions = {**whole["$defs"], **effects.pop("$defs", {}), "Effects": effects}
    return {**whole, "$defs": definitions}


def valid(node: Raw, top: Raw, depth: int = 0) -> st.SearchStrategy[Any]:
    """Values that a node of the schema allows."""
    if "$ref" in node:
        return valid(top["$defs"][node["$ref"].rpartition("/")[2]], top, depth)
    for choice in ("oneOf", "anyOf"):
        if choice in node:
            return st.one_of([valid(one, top, depth) for one in node[choice] if one.get("type") != "null"])
    if "const" in node or "enum" in node:
        return st.sampled_from(node.get("enum", [node.get("const")]))
    kind = node.get("type")
    if kind == "object":
        return tables(node, top, depth)
    if kind == "array":
        return arrays(node, top, depth)
    if kind in ("number", "integer"):
        return numbers(node)
    return {"string": st.sampled_from(("a", "Ω", "arm 1", "x" * 60)), "boolean": st.booleans()}.get(kind, st.just(1.0))


def tables(node: Raw, top: Raw, depth: int) -> st.SearchStrategy[Raw]:
    """Tables with all keys that must be there and some of the others."""
    has = {key: valid(one, top, depth + 1) for key, one in node.get("properties", {}).items() if depth < DEEPEST}
    must = set(node.get("required", ()))
    return st.fixed_dictionaries(
        {key: one for key, one in has.items() if key in must},
        optional={key: one for key, one in has.items() if key not in must},
    )


def arrays(node: Raw, top: Raw, depth: int) -> st.SearchStrategy[list]:
    """Lists of a few items; pydantic states tuples of fixed length by prefixItems."""
    if "prefixItems" in node:
        return st.tuples(*[valid(one, top, depth + 1) for one in node["prefixItems"]]).map(list)
    least = node.get("minItems", 0)
    return st.lists(
        valid(node.get("items", {}), top, depth + 1),
        min_size=least,
        max_size=min(node.get("maxItems", 4), max(4, least)),
    )


def numbers(node: Raw) -> st.SearchStrategy[float]:
    """Numbers within the bounds: mostly of the size that arms have, some at the ends."""
    low = node.get("minimum", node.get("exclusiveMinimum", -1e30))
    high = node.get("maximum", node.get("exclusiveMaximum", 1e30))
    if node["type"] == "integer":
        return st.integers(int(low), int(min(high, low + 12)))
    usual = st.floats(-3, 2).map(lambda power: 10.0**power).filter(lambda x: low <= x <= high)
    ends = [
        x for x in (low, high, 1e-30, 1e-6, 1e6) if low <= x <= high and not (x == low and "exclusiveMinimum" in node)
    ]
    return st.one_of(usual, usual, usual, st.sampled_from(ends or [1.0]))


def places(raw: Any, path: tuple = ()) -> Iterator[tuple]:
    """Every place of a scene, as a path of keys and indices."""
    if path:
        yield path
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for key, value in items:
        yield from places(value, (*path, key))


@st.composite
def mutated(draw: st.DrawFn, most: int = 4, wild: bool = True) -> tuple[str, Raw]:
    """A scene with 1 to `most` places changed; with `wild`, by nonsense too. Gives the scene's name and its tables."""
    name = draw(st.sampled_from(sorted(BASES)))
    raw = deepcopy(BASES[name])
    for _ in range(draw(st.integers(1, most))):
        path = draw(st.sampled_from(list(places(raw))))
        holder, key = at(raw, path[:-1]), path[-1]
        change = draw(
            st.sampled_from(
                ("value", "value", "scale", "drop", "add", "repeat") if wild else ("scale", "scale", "drop", "repeat")
            )
        )
        if change == "value":
            holder[key] = deepcopy(draw(st.sampled_from(NONSENSE)))
        elif change == "scale" and isinstance(holder[key], float | int) and not isinstance(holder[key], bool):
            factor = draw(st.sampled_from((-1.0, 0.0, 1e-6, 0.01, 0.5, 2.0, 10.0, 1e3, 1e8)))
            holder[key] = type(holder[key])(holder[key] * factor)
        elif change == "drop":
            del holder[key]
        elif change == "add" and isinstance(holder, dict):
            key = draw(st.sampled_from(("extra", "mass", "kind", "", "a.b", "\u00e9")))
            holder[key] = deepcopy(draw(st.sampled_from(NONSENSE)))
        elif change == "repeat" and isinstance(holder, list):
            for _ in range(draw(st.sampled_from((1, 1, 2, 5, 40) if wild else (1, 1, 2, 5)))):
                holder.insert(key, deepcopy(holder[key]))
    return name, raw


def from_schema() -> st.SearchStrategy[tuple[str, Raw]]:
    """Whole scenes that the schema allows, most of which contradict themselves."""
    whole = schema()
    return valid(whole, whole).map(lambda raw: ("schema", raw))


def at(raw: Any, path: tuple) -> Any:
    """What stands at a place."""
    for key in path:
        raw = raw[key]
    return raw


def to_toml(value: Any, top: bool = True) -> str:
    """A scene as TOML, its tables inline."""
    if isinstance(value, dict):
        items = [f"{json.dumps(key)} = {to_toml(one, False)}" for key, one in value.items() if one is not None]
        return "\n".join(items) + "\n" if top else "{" + ", ".join(items) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(to_toml(one, False) for one in value if one is not None) + "]"
    if isinstance(value, Bare):
        return value
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)
