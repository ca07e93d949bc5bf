"""The JSON schema, `new`, `show`, and what a refused value probably meant."""

import json
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest

import flexlin as fl
from flexlin.cli import main
from flexlin.scene import apply_overrides, builtin_scenes, known_effects, scene_schema, write_toml

pytestmark = pytest.mark.xdist_group("schema")


@cache
def schema() -> dict[str, Any]:
    """With the models that shipped scenes name: other tests register more."""
    named = {tomllib.loads(path.read_text(encoding="utf-8")).get("model") for path in builtin_scenes().values()}
    made = scene_schema()
    rules = [rule for rule in made["allOf"] if rule["if"]["properties"]["model"]["const"] in named]
    return {**made, "allOf": rules}


KINDS: dict[str, Any] = {
    "number": (int, float), "integer": int, "string": str, "boolean": bool, "object": dict, "array": (list, tuple), "null": type(None)
}  # fmt: skip


def accepts(node: dict[str, Any], value: Any) -> bool:
    """Whether a value is allowed, by the keywords that pydantic writes; nothing of flexlin's own."""
    if "$ref" in node:
        return accepts(schema()["$defs"][node["$ref"].rpartition("/")[2]], value)
    if value not in [node.get("const", value)] or value not in node.get("enum", [value]):
        return False
    for union in ("anyOf", "oneOf"):
        if union in node and not any(accepts(child, value) for child in node[union]):
            return False
    kind = node.get("type")
    if kind and (not isinstance(value, KINDS[kind]) or isinstance(value, bool) != (kind == "boolean")):
        return False
    if isinstance(value, int | float):
        inside = node.get("minimum", value) <= value <= node.get("maximum", value)
        return inside and value > node.get("exclusiveMinimum", -np.inf)
    if isinstance(value, dict) and "properties" in node:
        keys = node["properties"]
        known = set(value) <= set(keys) or node.get("additionalProperties") is not False
        inside = all(accepts(keys[key], child) for key, child in value.items() if key in keys)
        return known and set(node.get("required", ())) <= set(value) and inside
    if isinstance(value, str):
        return re.search(node.get("pattern", ""), value) is not None
    return not (isinstance(value, list) and "items" in node) or all(accepts(node["items"], child) for child in value)


def raw_scene(name: str) -> dict[str, Any]:
    return tomllib.loads(builtin_scenes()[name].read_text(encoding="utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_scenes())
def test_every_scene_fits_the_schema(name):
    raw = raw_scene(name)
    assert accepts(schema(), raw)
    for rule in schema()["allOf"]:
        if raw.get("model") == rule["if"]["properties"]["model"]["const"]:
            assert accepts(rule["then"], raw)
            assert not accepts(rule["then"], {**raw, "parameters": {**raw["parameters"], "lenght": 1.0}})


@pytest.mark.parametrize(
    "change",
    [{"links.0.lenght": 1.0}, {"links.0.length": "long"}, {"links.0.modes": 2.5}, {"effects.shear": {"stiffness": -1.0}},
     {"effects.magnetism": {}}, {"motion.kind": "spiral"}, {"control.feedback.kp": 3.0}, {"links.0.length": -1.0}],
)  # fmt: skip
def test_what_the_schema_refuses_flexlin_refuses(change):
    raw, _ = apply_overrides(raw_scene("single-link"), change)
    assert not accepts(schema(), raw)
    with pytest.raises(fl.errors.SceneError):
        fl.parse_scene(raw)


def numbers(node: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every key of every table, with its path."""
    if isinstance(node, dict):
        for key, child in node.get("properties", {}).items():
            yield f"{path}.{key}", child
        for key, child in node.items():
            yield from numbers(child, f"{path}.{key}")
    elif isinstance(node, list):
        for child in node:
            yield from numbers(child, path)


COUNTS = {
    "modes", "elements", "phases", "tol", "schema", "state_weight", "input_weight", "axis", "normal", "direction", "at", "mass", "stiffness"
}  # fmt: skip
"""Keys that are counts, ratios or directions, or are relative in one table and bear a unit in another."""


def test_every_key_has_a_description_and_every_number_a_unit():
    found = {path: node for path, node in numbers(schema()) if ".if." not in path}
    assert len(found) > 90
    assert [path for path, node in found.items() if not node.get("description")] == []
    assert set(known_effects()) <= set(schema()["$defs"]["Effects"]["properties"])
    text = [(path.rpartition(".")[2], json.dumps(node)) for path, node in found.items()]
    assert {key for key, words in text if '"number"' in words and '"unit"' not in words} <= COUNTS


@pytest.mark.slow
@pytest.mark.parametrize("name", builtin_scenes())
def test_a_new_scene_says_what_its_model_says(name, tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert main(["new", str(tmp_path / "mine"), "--like", name]) == 0
    old, made, text = fl.load_scene(name), fl.load_scene(path), path.read_text()
    assert made.model_copy(update={"title": old.title, "source": old.source}) == old
    assert made.title == "mine"
    assert all(" # " in line for line in text.splitlines() if " = " in line and not line.startswith("#"))
    assert main(["new", str(path), "--like", name]) == 2
    assert path.read_text() == text
    assert "there already" in capsys.readouterr().err


def test_show_prints_the_file(capsys):
    assert main(["show", "spinning-link"]) == 0
    assert capsys.readouterr().out == builtin_scenes()["spinning-link"].read_text(encoding="utf-8")
    assert main(["show", "spinning-lnk"]) == 2
    assert "did you mean 'spinning-link'?" in capsys.readouterr().err
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out) == scene_schema()


def test_what_is_written_reads_back():
    texts = {"c": True, "d": 'q"uo\\te\n\t\x7f', "with space": {"a.b": 1, "": 2}, "f": {}, "g": []}
    data = texts | {"a": 1e-300, "b": -0.0, "e": [1, [2.5, "x"], {"k": 1}], "deep": {"er": [{"x": [{"y": 1}]}, {}]}}
    assert tomllib.loads(write_toml(data)) == data
    assert tomllib.loads(write_toml(data, lambda path: "note")) == data
