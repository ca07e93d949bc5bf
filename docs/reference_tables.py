"""The reference pages' tables, made from the code when the site is built: commands from their parser, scenes from their schema."""

import argparse
from typing import Any

from flexlin.cli.program import parser
from flexlin.scene.json_schema import scene_schema


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    cells = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *cells])


def commands() -> str:
    """A section for each command: its purpose, its options."""
    top = parser()
    names = next(action for action in top._actions if isinstance(action, argparse._SubParsersAction))
    return "\n\n".join(command(name, found) for name, found in names.choices.items())


def command(name: str, found: argparse.ArgumentParser) -> str:
    """One command's section."""
    rows = []
    for action in found._actions:
        if isinstance(action, argparse._HelpAction):
            continue
        flag = ", ".join(action.option_strings) or str(action.metavar)
        value = "" if not action.option_strings or action.nargs == 0 else f" {action.metavar or choice(action)}"
        rows.append([f"`{flag}{value}`", (action.help or "").replace("%%", "%")])
    options = table(["argument", "what it does"], rows) if rows else ""
    return f"## flexlin {name}\n\n{found.description}.\n\n{options}"


def choice(action: argparse.Action) -> str:
    """What an option without a metavar takes."""
    return "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest.upper()


def scene() -> str:
    """A section for each table of a scene: keys, kinds, units, defaults."""
    schema = scene_schema()
    tables = {"Scene": schema} | schema["$defs"]
    return "\n\n".join(section(name, found) for name, found in tables.items() if "properties" in found)


def section(name: str, found: dict[str, Any]) -> str:
    """One table's section."""
    required = found.get("required", [])
    rows = [
        [
            f"`{key}`",
            kind(entry),
            entry.get("unit", ""),
            "required" if key in required else default(entry),
            words(entry).removesuffix(f" [{entry.get('unit')}]"),
        ]
        for key, entry in found["properties"].items()
    ]
    text = words(found) if name != "Scene" else "The whole file."
    return f"({name.lower()}-table)=\n\n## {name}\n\n{text}\n\n{table(['key', 'what it takes', 'unit', 'default', 'meaning'], rows)}"


def words(entry: dict[str, Any]) -> str:
    """The description, on one line."""
    return " ".join(entry.get("description", "").split())


def default(entry: dict[str, Any]) -> str:
    """The value of a key that is left out."""
    value = entry.get("default")
    return "" if (not value and value != 0) or isinstance(value, dict) else f"`{value}`"


def kind(entry: dict[str, Any]) -> str:
    """What a key takes, in words."""
    if "$ref" in entry:
        name = entry["$ref"].rsplit("/", 1)[-1]
        return f"[{name}](#{name.lower()}-table)"
    for several in ("anyOf", "oneOf", "allOf"):
        if several in entry:
            return " or ".join(dict.fromkeys(kind(option) for option in entry[several] if option.get("type") != "null"))
    if "enum" in entry or "const" in entry:
        return ", ".join(f"`{value}`" for value in entry.get("enum", [entry.get("const")]))
    if entry.get("type") == "array":
        return f"list of {kind(entry.get('items') or {})}" if entry.get("items") else "list"
    bounds = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    limits = [f"{sign} {entry[key]:g}" for key, sign in bounds.items() if key in entry and abs(entry[key]) < 1e30]
    return ", ".join(
        [
            {"string": "text", "object": "table", "integer": "whole number"}.get(
                entry.get("type", ""), entry.get("type", "value")
            ),
            *limits,
        ]
    )
