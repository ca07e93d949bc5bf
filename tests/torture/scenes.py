"""Scenes that nobody wrote: drawn from the JSON schema, or the built-in ones and some more with places changed; the files beside them."""

import json
import math
import random
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

from flexlin import Scene
from flexlin.scene import builtin_scenes, effects_table

Raw = dict[str, Any]
BUILT_IN = {name: tomllib.loads(path.read_text(encoding="utf-8")) for name, path in builtin_scenes().items()}


def sampled_cycle(rows: int = 64) -> str:
    """A motion table of one joint."""
    lines = [f"{2.0 * k / rows!r},{0.4 * math.sin(2 * math.pi * k / rows)!r}" for k in range(rows + 1)]
    return "t,q1\n" + "\n".join(lines) + "\n"


def measured(rows: int = 60) -> str:
    """A log of one joint: its torque, its angle, and the tip's place."""
    times = [0.01 * k for k in range(rows)]
    return "t,u,angle,x\n" + "".join(f"{t!r},{math.sin(9 * t)!r},{0.1 * math.cos(5 * t)!r},{t * t!r}\n" for t in times)


def of_table() -> Raw:
    """A motion that stands in a file."""
    return {**deepcopy(BUILT_IN["single-link"]), "motion": {"kind": "table", "file": "cycle.csv"}}


def of_series() -> Raw:
    """A Fourier series, judged about the elastic motion too, with tip-exact feedforward."""
    raw = deepcopy(BUILT_IN["single-link"])
    joints = [{"mean": 0.1, "cos": [0.2, 0.05], "sin": [0.1]}]
    raw["motion"] = {"kind": "fourier", "period": 2.0, "joints": joints}
    raw["control"] |= {"about": "elastic", "feedforward": "tip-exact"}
    return raw


def of_one_way() -> Raw:
    """A motion that ends, with a design over its horizon."""
    raw = deepcopy(BUILT_IN["pick-and-place"])
    raw["motion"]["course"] = "one-way"
    weights = {"joints": "0.5 deg", "rates": "5 deg/s", "deflection": "8 mm", "input": "3 N m"}
    raw["designs"] = [{"name": "to the end", "kind": "finite-horizon-lqr", "weights": weights}]
    return raw


def of_designs() -> Raw:
    """Every kind of design, an estimator, drives, and a sampled loop."""
    raw = deepcopy(BUILT_IN["single-link"])
    kinds = ("periodic", "frozen", "averaged")
    weights = deepcopy(raw["designs"][0]["weights"])
    raw["designs"] = [{"name": f"{kind} Ω", "kind": f"{kind}-lqr", "weights": weights} for kind in kinds]
    raw["designs"][0]["estimator"] = {"encoders": "0.02 deg", "tip": "1 mm", "torque": "10 mN m"}
    raw["control"] |= {"sampling": {"period": 0.004, "delay": 0.001}, "saturation": {"torque": [2.0]}}
    raw["drives"] = {"torque": {"peak": "12 N m", "continuous": "5 N m"}, "speed": "180 deg/s"}
    return raw


BASES: dict[str, Raw] = {
    **BUILT_IN,
    "table": of_table(),
    "series": of_series(),
    "one-way": of_one_way(),
    "designs": of_designs(),
}
"""Scenes that are changed, by name."""
URDF = builtin_scenes()["manutec-r3"].with_suffix(".urdf").read_text(encoding="utf-8")
FILES = {
    "cycle.csv": sampled_cycle(),
    "log.csv": measured(),
    "manutec-r3.urdf": URDF,
    "words.csv": "t,q1\n0,secret\n1,2\n",
    "nan.csv": "t,q1\n0,nan\n1,inf\n2,0\n",
    "back.csv": "t,q1\n0,0\n2,1\n1,0\n",
    "wide.csv": "t" + ",q" * 3000 + "\n" + "0," * 3000 + "0\n",
    "none.csv": "",
    "half.urdf": URDF[: len(URDF) // 2],
    "nested.urdf": "<robot name='x'>" + "<link>" * 5000 + "</link>" * 5000 + "</robot>",
}
"""What stands beside a scene, whole and broken."""


def put_files(folder: Path) -> None:
    """Put the files beside the scenes of a folder, and a folder of that kind of name."""
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "folder.csv").mkdir(exist_ok=True)


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


@cache
def schema() -> Raw:
    """The JSON schema of a scene, with the tables of all effects."""
    whole, effects = Scene.model_json_schema(), effects_table().model_json_schema()
    definitions = {**whole["$defs"], **effects.pop("$defs", {}), "Effects": effects}
    return {**whole, "$defs": definitions}


def valid(chance: random.Random, node: Raw, top: Raw, depth: int = 0) -> Any:
    """A value that a node of the schema allows: of tables some of the keys that need not be there; tuples are stated by prefixItems."""
    if "$ref" in node:
        return valid(chance, top["$defs"][node["$ref"].rpartition("/")[2]], top, depth)
    for choice in ("oneOf", "anyOf"):
        if choice in node:
            return valid(chance, chance.choice([one for one in node[choice] if one.get("type") != "null"]), top, depth)
    if "const" in node or "enum" in node:
        return chance.choice(node.get("enum", [node.get("const")]))
    kind, must = node.get("type"), node.get("required", ())
    if kind == "object":
        has = node.get("properties", {}) if depth < DEEPEST else {}
        keys = [key for key in has if key in must or chance.random() < 0.5]
        return {key: valid(chance, has[key], top, depth + 1) for key in keys}
    if kind == "array":
        least = node.get("minItems", 0)
        count = chance.randint(least, min(node.get("maxItems", 4), max(4, least)))
        items = node.get("prefixItems", [node.get("items", {})] * count)
        return [valid(chance, one, top, depth + 1) for one in items]
    if kind in ("number", "integer"):
        return number(chance, node)
    return {"string": chance.choice(("a", "Ω", "arm 1", "x" * 60)), "boolean": chance.random() < 0.5}.get(kind, 1.0)


def number(chance: random.Random, node: Raw) -> float:
    """A number within the bounds: mostly of the size that arms have, some at the ends."""
    low = node.get("minimum", node.get("exclusiveMinimum", -1e30))
    high = node.get("maximum", node.get("exclusiveMaximum", 1e30))
    if node["type"] == "integer":
        return chance.randint(int(low), int(min(high, low + 12)))
    usual = [10.0 ** chance.uniform(-3, 2) for _ in range(9)]
    drawn = chance.choice((*usual, low, high, 1e-30, 1e-6, 1e6))
    inside = low <= drawn <= high and not (drawn == low and "exclusiveMinimum" in node)
    return drawn if inside else (low + min(high, low + 2.0)) / 2


def places(raw: Any, path: tuple = ()) -> Iterator[tuple]:
    """Every place of a scene, as a path of keys and indices."""
    if path:
        yield path
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for key, value in items:
        yield from places(value, (*path, key))


def mutated(chance: random.Random, most: int = 4, wild: bool = True) -> tuple[str, Raw]:
    """A scene with 1 to `most` places changed; with `wild`, by nonsense too. Gives the scene's name and its tables."""
    name = chance.choice(sorted(BASES))
    raw = deepcopy(BASES[name])
    changes = ("value", "value", "scale", "drop", "add", "repeat") if wild else ("scale", "scale", "drop", "repeat")
    for _ in range(chance.randint(1, most)):
        path, change = chance.choice(list(places(raw))), chance.choice(changes)
        holder, key = at(raw, path[:-1]), path[-1]
        if change == "value":
            holder[key] = deepcopy(chance.choice(NONSENSE))
        elif change == "scale" and isinstance(holder[key], float | int) and not isinstance(holder[key], bool):
            factor = chance.choice((-1.0, 0.0, 1e-6, 0.01, 0.5, 2.0, 10.0, 1e3, 1e8))
            holder[key] = type(holder[key])(holder[key] * factor)
        elif change == "drop":
            del holder[key]
        elif change == "add" and isinstance(holder, dict):
            key = chance.choice(("extra", "mass", "kind", "", "a.b", "\u00e9"))
            holder[key] = deepcopy(chance.choice(NONSENSE))
        elif change == "repeat" and isinstance(holder, list):
            for _ in range(chance.choice((1, 1, 2, 5, 40) if wild else (1, 1, 2, 5))):
                holder.insert(key, deepcopy(holder[key]))
    return name, raw


def from_schema(chance: random.Random) -> tuple[str, Raw]:
    """A whole scene that the schema allows; most contradict themselves."""
    whole = schema()
    return "schema", valid(chance, whole, whole)


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
