"""The JSON schema of a scene, and scenes as TOML: plain data, or with a comment behind each key and the effects that are off."""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from flexlin.scene.effects import effects_table, known_effects
from flexlin.scene.library import registered_model, shipped_models
from flexlin.scene.links import ASKED
from flexlin.scene.parameters import PARAMETERS
from flexlin.scene.problems import Place
from flexlin.scene.scene import FlexibleTable, JointTable, RobotTable, Scene

DIALECT = "https://json-schema.org/draft/2020-12/schema"
PLACE = "#/$defs/{model}"


def scene_schema() -> dict[str, Any]:
    """Return the JSON schema of a scene, with a description for every key and a unit for every number that has one.

    Returns
    -------
    dict
        A schema of the 2020-12 dialect. A key's `unit` is in SI units or radians, empty for a ratio. `parameters` follows the
        registered model that a scene names.

    Examples
    --------
    >>> from flexlin.scene import scene_schema
    >>> length = scene_schema()["$defs"]["Link"]["properties"]["length"]
    >>> length["unit"], length["description"]
    ('m', 'Length from joint to tip. [m]')
    """
    schema = Scene.model_json_schema(ref_template=PLACE)
    definitions = schema["$defs"]
    definitions["Effects"] = add_table(definitions, effects_table())
    needed = {"required": definitions["Link"].pop("required")}
    sufficient = ({"required": ["length", "section"]}, {"required": ["body"]})  # a rigid body alone is a link too
    definitions["Link"]["anyOf"] = [needed, *sufficient]
    for name in ASKED:
        del definitions[name.title().replace("_", "")]["required"]  # sections may stand for it
    for key, table, what in (
        ("robot", RobotTable, "A robot from a URDF file."),
        ("joints", JointTable, "For a robot from a URDF file, by name: springs and gears."),
        ("flexible", FlexibleTable, "For a robot from a URDF file, by name: links that bend."),
    ):
        definitions[table.__name__] = add_table(definitions, table)
        one = {"$ref": PLACE.format(model=table.__name__)}
        held = one if key == "robot" else {"type": "object", "additionalProperties": one}
        schema["properties"][key] = {**held, "description": what}
    of_models = {name: add_table(definitions, model.schema) for name, model in shipped_models().items()}
    schema["allOf"] = [
        {
            "if": {"properties": {"model": {"const": name}}, "required": ["model"]},
            "then": {"properties": {"parameters": {**table, "description": "The registered model's own table."}}},
        }
        for name, table in of_models.items()
    ]
    return {"$schema": DIALECT, **schema}


def add_table(definitions: dict[str, Any], table: type[BaseModel]) -> dict[str, Any]:
    """Put what a table's schema defines beside what is defined already; returns the schema without it.

    The table of effects is made when effects are registered, so a reference to it is to the one that holds them all.
    """
    made = table.model_json_schema(ref_template=PLACE)
    for name, found in made.pop("$defs", {}).items():
        definitions.setdefault(name, found)
    return made


def commented_scene(data: dict[str, Any]) -> str:
    """The scene as TOML: beside each key what it means and its unit, and below it the effects that could be turned on."""
    on, model = data.get("effects", {}), data.get("model")
    more = [f"# [effects.{name}]  {effect.summary()}" for name, effect in known_effects().items() if name not in on]
    text = write_toml(data, lambda path: note(path, model))
    if model is not None:
        return text
    return text + "\n# Effects that are off; each table turns one on:\n" + "\n".join(more) + "\n"


def note(path: tuple[str, ...], model: str | None) -> str:
    """What is said of a key in a comment: its description and unit; nothing where no table knows it."""
    of_model = model is not None and path[0] == PARAMETERS and len(path) > 1
    place = Place.of(registered_model(str(model)).schema, path[1:]) if of_model else Place.of(Scene, path)
    described = next((field.description for field in place.fields if field.description), "")
    return described.partition("\n")[0] + (f" [{place.unit}]" if place.unit else "")


Note = Callable[[tuple[str, ...]], str]
BARE = re.compile(r"[A-Za-z0-9_-]+")


def write_toml(data: Mapping[str, Any], note: Note = lambda path: "") -> str:
    """Write plain data as TOML: tables below their headings, lists of tables as [[...]], all else on one line.

    Holds texts, truth values, finite numbers, lists and tables; keys whose value is None are left out. What `note` says of a path of
    keys stands behind it as a comment.
    """
    return "\n".join(list_lines(data, (), note)).strip() + "\n"


def list_lines(table: Mapping[str, Any], path: tuple[str, ...], note: Note) -> Iterator[str]:
    """The lines of one table: its values first, then the tables in it."""
    given = {key: value for key, value in table.items() if value is not None}
    below = {key: value for key, value in given.items() if isinstance(value, Mapping) or is_list_of_tables(value)}
    for key, value in given.items():
        if key not in below:
            yield with_note(f"{write_key(key)} = {write_value(value)}", note((*path, key)))
    for key, value in below.items():
        name = ".".join(map(write_key, (*path, key)))
        single = isinstance(value, Mapping)
        for child in [value] if single else value:
            yield ""
            yield with_note(f"[{name}]" if single else f"[[{name}]]", note((*path, key)))
            yield from list_lines(child, (*path, key), note)


def with_note(line: str, note: str) -> str:
    """A line with a comment behind it."""
    return f"{line:<36} # {note}" if note else line


def is_list_of_tables(value: Any) -> bool:
    """Whether a value is a list of tables, which has headings of its own."""
    return isinstance(value, list | tuple) and len(value) > 0 and all(isinstance(one, Mapping) for one in value)


def write_key(key: str) -> str:
    """A key, in quotes where it needs them."""
    return key if BARE.fullmatch(key) else json.dumps(key)


def write_value(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, float) and math.isfinite(value):
        return repr(value)
    if isinstance(value, Mapping):
        inside = ", ".join(
            f"{write_key(key)} = {write_value(child)}" for key, child in value.items() if child is not None
        )
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(write_value, value))}]"
    return str(value)
