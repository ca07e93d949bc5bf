"""The JSON schema of a scene, from which editors complete and check."""

from typing import Any

from pydantic import BaseModel

from flexlin.scene.effects import effects_table, known_effects
from flexlin.scene.key_docs import describe_keys
from flexlin.scene.library import shipped_models
from flexlin.scene.robot import FlexibleTable, JointTable, RobotTable
from flexlin.scene.scene import Scene

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
    describe_keys(schema, Scene)
    definitions = schema["$defs"]
    definitions["Effects"] = add_table(definitions, effects_table())
    for name, effect in known_effects().items():
        definitions["Effects"]["properties"][name]["description"] = effect.summary()
    needed = {"required": definitions["Link"].pop("required")}
    definitions["Link"]["anyOf"] = [needed, {"required": ["body"]}]  # a rigid body alone is a link too
    definitions["RobotTable"] = add_table(definitions, RobotTable)
    schema["properties"]["robot"] = {
        "$ref": PLACE.format(model="RobotTable"),
        "description": "A robot from a URDF file.",
    }
    for key, table, what in (
        ("joints", JointTable, "springs and gears"),
        ("flexible", FlexibleTable, "links that bend"),
    ):
        definitions[table.__name__] = add_table(definitions, table)
        inner = {"$ref": PLACE.format(model=table.__name__)}
        described = f"For a robot from a URDF file, by name: {what}."
        schema["properties"][key] = {"type": "object", "additionalProperties": inner, "description": described}
    known = {name: add_table(definitions, model.schema) for name, model in shipped_models().items()}
    schema["allOf"] = [
        {
            "if": {"properties": {"model": {"const": name}}, "required": ["model"]},
            "then": {"properties": {"parameters": {**table, "description": "The registered model's own table."}}},
        }
        for name, table in known.items()
    ]
    write_units(schema)
    return {"$schema": DIALECT, **schema}


def add_table(definitions: dict[str, Any], table: type[BaseModel]) -> dict[str, Any]:
    """Put what a table's schema defines beside what is defined already; returns the schema without it.

    The table of effects is made when effects are registered, so a reference to it is to the one that holds them all.
    """
    made = table.model_json_schema(ref_template=PLACE)
    describe_keys(made, table)
    for name, found in made.pop("$defs", {}).items():
        definitions.setdefault(name, found)
    return made


def write_units(node: Any) -> None:
    """Let every description end with the unit, which editors show."""
    if isinstance(node, list):
        for child in node:
            write_units(child)
    elif isinstance(node, dict):
        inner = [child.get("unit") for child in node.get("anyOf", ()) if isinstance(child, dict)]
        unit = node.get("unit") or next(filter(None, inner), None)
        if isinstance(unit, str) and isinstance(node.get("description"), str):
            node["description"] = f"{node['description']} [{unit}]"
        for child in node.values():
            write_units(child)
