"""What the schema complains about, said as key, got, expected, and what was probably meant, in the words of the file's writer."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from flexlin.bounds import LONGEST_SHOWN, MOST_ITEMS, hint_at, printable
from flexlin.errors import Problem, SceneError
from flexlin.scene.base import Table
from flexlin.scene.effects import Effects, effects_table
from flexlin.scene.units import NAMES, split_units

AnyTable = TypeVar("AnyTable", bound=BaseModel)


def name_units(units: str) -> str:
    """In what a bare number is, and what may be written with a unit: in rad or m, or an angle such as 0.5 deg."""
    written = [NAMES[unit] for unit in split_units(units) if unit in NAMES]
    where = (" where all joints turn", " where all slide") if len(written) == 2 else ("",) * len(written)
    return ", or ".join([f" in {units}", *map("".join, zip(written, where, strict=True))])


WORDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a text",
    "string_unicode": "a text in UTF-8",
    "tuple_type": "a list [...]",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
}


def schema_problems(schema: type[BaseModel], error: ValidationError) -> list[Problem]:
    """All that pydantic found wrong, one problem a key; of a list that is no number either, only what is wrong in the list."""
    merged: dict[str, Problem] = {}
    entries = error.errors(include_url=False)
    for entry in entries[:MOST_ITEMS]:  # each may ask for a search among all known keys
        if entry["type"] == "too_short" and len(entry["input"]) >= entry["ctx"]["min_length"]:
            continue  # only because items in it are wrong
        problem = _problem(schema, entry)
        known = merged.get(problem.key)
        if known is None:
            merged[problem.key] = problem
        elif problem.expected not in known.expected:
            merged[problem.key] = Problem(problem.key, known.got, f"{known.expected} or {problem.expected}")
    steps = [key.split(".") for key in merged]
    parents = {".".join(path[:depth]) for path in steps for depth in range(1, len(path))}
    found = [problem for key, problem in merged.items() if key not in parents]
    beyond = len(entries) - MOST_ITEMS
    if beyond > 0:
        found.append(Problem("scene", f"{beyond} further mistakes", "those above corrected first"))
    return found


def read_table(schema: type[BaseModel], raw: Any, key: str, problems: list[Problem]) -> Any:
    """One table by its schema, or None with its problems added."""
    try:
        return schema.model_validate(raw)
    except ValidationError as error:
        problems += [
            Problem(f"{key}.{p.key}" if p.key != "scene" else key, p.got, p.expected)
            for p in schema_problems(schema, error)
        ]
        return None


def checked_table(schema: type[AnyTable], raw: Mapping[str, Any], source: str, key: str) -> AnyTable:
    """Check one raw table by its schema; raises SceneError with all problems, their keys below `key`."""
    problems: list[Problem] = []
    table: AnyTable = read_table(schema, dict(raw), key, problems)
    if problems:
        raise SceneError(source, problems)
    return table


@dataclass(frozen=True)
class Place:
    """Where something is wrong: the keys that lead there in the file, and the tables in which the last of them may stand."""

    keys: tuple[str | int, ...] = ()
    tables: tuple[type[BaseModel], ...] = ()

    @classmethod
    def of(cls, schema: type[BaseModel], location: Sequence[str | int]) -> "Place":
        """The place of a location of pydantic's, which names the branches of unions too."""
        place = cls()
        inside: tuple[type[BaseModel], ...] = (schema,)
        for step in location:
            if isinstance(step, int):
                place = cls((*place.keys, step), place.tables)
            elif any(step in _kinds_of(table) for table in inside):
                inside = tuple(table for table in inside if step in _kinds_of(table))
            elif "[" not in step and step not in ("float", "constrained-float"):
                place = cls((*place.keys, step), inside)
                inside = place.models or inside  # the names of a table of tables are no keys of these
        return place

    @property
    def name(self) -> str:
        """The last key, but for the numbers of what stands in its list."""
        return next((key for key in reversed(self.keys) if isinstance(key, str)), "")

    @property
    def fields(self) -> list[FieldInfo]:
        """What the last key is, in each of its tables that has it."""
        known = [item for table in self.tables for item in table.model_fields.items()]
        return [field for name, field in known if self.name in (name, field.alias)]

    @property
    def annotations(self) -> list[Any]:
        """What the last key may hold."""
        return [field.annotation for field in self.fields]

    @property
    def models(self) -> tuple[type[BaseModel], ...]:
        """The tables that it may hold."""
        return tuple(model for annotation in self.annotations for model in list_tables(annotation))

    @property
    def kinds(self) -> list[str]:
        """Their kinds, in quotes."""
        return [f'"{kind}"' for model in self.models for kind in _kinds_of(model)]

    @property
    def unit(self) -> str | None:
        """The unit that the last key states."""
        units = (table.units().get(self.name) for table in self.tables if issubclass(table, Table))
        return next(filter(None, units), None)

    def known_keys(self) -> str:
        """The keys that its table may hold, the likeliest first."""
        fields = [item for table in self.tables for item in table.model_fields.items()]
        before = [key for table in self.tables if issubclass(table, Table) for key in table.read_before]
        keys = sorted({*before, *(field.alias or name for name, field in fields)})
        return f"one of {', '.join(keys)}{hint_at(self.name, keys)}" if keys else "an empty table"

    def needed(self, key: str) -> str:
        """What the last key must hold where it is not there."""
        if not self.models:
            choices = [
                str(one) for literal in self.annotations if get_origin(literal) is Literal for one in get_args(literal)
            ]
            return " or ".join(choices) or (f"a value in {self.unit}" if self.unit else "a value")
        if any(get_origin(annotation) is tuple for annotation in self.annotations):
            return f"a list of tables, [[{key}]] or {self.name} = [{{ ... }}]"
        return f"a table [{key}]" + (f" with kind = {' or '.join(self.kinds)}" if self.kinds else "")


def _kinds_of(table: type[BaseModel]) -> tuple[Any, ...]:
    """The values of the key `kind` of a table that is a branch of a union by it."""
    return get_args(table.model_fields["kind"].annotation) if "kind" in table.model_fields else ()


def list_tables(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables that an annotation allows, inside lists and unions too."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield effects_table() if annotation is Effects else annotation
    for part in get_args(annotation):
        yield from list_tables(part)


def _problem(schema: type[BaseModel], entry: Any) -> Problem:
    kind, context, place = entry["type"], entry.get("ctx", {}), Place.of(schema, entry["loc"])
    key = printable(".".join(map(str, place.keys))) or "scene"
    if kind == "extra_forbidden":
        return Problem(key, "an unknown key", place.known_keys())
    if kind == "missing":
        return Problem(key, "nothing", f"{place.needed(key)}: this key is required")
    if kind == "union_tag_not_found":
        return Problem(f"{key}.kind", "nothing", f"one of {', '.join(place.kinds)}: this key is required")
    got, expected, hint = repr(entry["input"]), _expected(kind, context, entry["msg"]), ""
    if kind == "union_tag_invalid":
        key, got, expected = f"{key}.kind", repr(context["tag"]), f"one of {context['expected_tags']}"
        hint = hint_at(str(context["tag"])[:LONGEST_SHOWN], re.findall(r"'([^']*)'", expected))
    elif kind == "literal_error":
        hint = hint_at(str(entry["input"])[:LONGEST_SHOWN], re.findall(r"'([^']*)'", context["expected"]))
    elif kind == "tuple_type" and isinstance(entry["input"], dict):
        hint = ", each under a heading in two brackets, [[ ]]"
    elif kind in ("float_type", "int_type") and isinstance(entry["input"], str) and place.unit:
        hint = name_units(place.unit)
    return Problem(key, got[:LONGEST_SHOWN], expected + hint)


def _expected(kind: str, context: Any, message: str) -> str:
    """The words for what a schema expects."""
    if kind == "too_short":
        return f"a list of {context['min_length']} or more"
    if kind == "too_long":
        return f"a length of {context['max_length']} at most"
    message = message.removeprefix("Input should be ").removeprefix("Value error, ")
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        return f"a number {message.rpartition(' ')[0]} {next(iter(context.values())):.12g}"
    return WORDS.get(kind, message)
