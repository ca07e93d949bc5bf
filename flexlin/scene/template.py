"""A scene with a comment beside every key: what `flexlin new` writes."""

from typing import Any

from flexlin.scene.json_schema import scene_schema
from flexlin.scene.toml_text import write_toml

DEEP = 6
"""Unions and references that lie on the way to one table's keys, at the most."""


def commented_scene(data: dict[str, Any]) -> str:
    """The scene as TOML: beside each key what it means and its unit, and below it the effects that could be turned on."""
    schema = scene_schema()
    on, effects = data.get("effects", {}), schema["$defs"]["Effects"]["properties"]
    more = [f"# [effects.{name}]  {effects[name]['description']}" for name in effects if name not in on]
    text = write_toml(data, lambda path: note(schema, data, path))
    if data.get("model") is not None:
        return text
    return text + "\n# Effects that are off; each table turns one on:\n" + "\n".join(more) + "\n"


def note(schema: dict[str, Any], data: dict[str, Any], path: tuple[str, ...]) -> str:
    """What is said of a key in a comment: its description; nothing where the schema knows none."""
    nodes = [schema]
    if path[:1] == ("parameters",):
        chosen = [
            rule["then"] for rule in schema["allOf"] if rule["if"]["properties"]["model"]["const"] == data.get("model")
        ]
        nodes = [*chosen, schema]
    for step in path:
        nodes = [found[step] for node in nodes for found in keys_of(schema, node) if step in found]
    described = [node["description"] for node in nodes if "description" in node]
    return described[0].partition("\n")[0] if described else ""


def keys_of(schema: dict[str, Any], node: dict[str, Any], depth: int = 0) -> list[dict[str, Any]]:
    """The keys of all tables that a node allows, through references, unions and lists."""
    if depth > DEEP:
        return []
    if "$ref" in node:
        return keys_of(schema, schema["$defs"][node["$ref"].rpartition("/")[2]], depth + 1)
    found = [node["properties"]] if "properties" in node else []
    inner = [
        *node.get("anyOf", []),
        *node.get("oneOf", []),
        *([node["items"]] if isinstance(node.get("items"), dict) else []),
    ]
    return found + [keys for child in inner for keys in keys_of(schema, child, depth + 1)]
