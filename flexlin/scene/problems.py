"""What the schema complains about, said as key, got, expected, and what was probably meant, in the words of the file's writer."""

import re
from collections.abc import Iterator, Sequence
from math import isfinite
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError

from flexlin.bounds import LONGEST_NUMBER, LONGEST_SHOWN, hint_at, printable
from flexlin.errors import Problem
from flexlin.scene.base import Table
from flexlin.scene.effects import Effects, effects_table
from flexlin.scene.units import NAMES, read_quantity

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
NUMBERS = re.compile(rf"\s*[\[(]?\s*({NUMBER}(?:[\s,;]+{NUMBER})*)\s*[,;]?\s*[\])]?\s*")


def suggest(kind: str, value: Any, unit: str | None) -> str:
    """Words for what was meant, to stand behind what was expected; empty where there is no guess.

    kind: pydantic's name of what is wrong; unit: of the key, where it states one.
    """
    if kind == "tuple_type":
        return ", each under a heading in two brackets, [[ ]]" if isinstance(value, dict) else suggest_list(value)
    if kind in ("float_type", "int_type") and isinstance(value, str) and len(value) <= LONGEST_NUMBER:
        return suggest_number(value, unit)
    if kind in ("float_type", "int_type") and isinstance(value, list | tuple) and len(value) == 1:
        return f"; did you mean {value[0]!r}?" if isinstance(value[0], int | float) else ""
    return ""


def suggest_list(value: Any) -> str:
    """A list of the numbers in a text or of a single number: 5,2 may mean [5, 2]."""
    if isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value):
        return f"; did you mean [{value}]?"
    found = NUMBERS.fullmatch(value) if isinstance(value, str) and len(value) <= LONGEST_NUMBER else None
    if found is None:
        return ""
    numbers = re.findall(NUMBER, found.group(1))
    return f"; did you mean [{', '.join(numbers)}]?"


def suggest_number(value: str, unit: str | None) -> str:
    """The SI value of a quantity with a unit: 96 cm may mean 0.96."""
    try:
        number, dimension = read_quantity(value)
    except ValueError:
        return name_units(unit) if unit and re.match(rf"\s*{NUMBER}\s*\D", value) else ""
    if unit and dimension is not None:
        return name_units(unit)
    return f"; did you mean {number:.12g}? Numbers are in {unit or 'SI units'}"


def name_units(units: str) -> str:
    """In what a bare number is, and what may be written with a unit: in rad or m, or an angle such as 0.5 deg."""
    written = [NAMES[unit] for unit in re.split(r" or |, ", units) if unit in NAMES]
    where = (" where the joint turns", " where it slides") if len(written) == 2 else ("",) * len(written)
    return ", or ".join([f" in {units}", *map("".join, zip(written, where, strict=True))])


WORDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a text",
    "string_unicode": "a text in UTF-8",
    "tuple_type": "a list",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
}
MOST = 200
"""Mistakes of one scene that are described: each may ask for a search among all known keys."""


def schema_problems(schema: type[BaseModel], error: ValidationError) -> list[Problem]:
    """All that pydantic found wrong, one problem a key; of a list that is no number either, only what is wrong in the list."""
    merged: dict[str, Problem] = {}
    entries = error.errors(include_url=False)
    for entry in entries[:MOST]:
        if follows_from_another(entry):
            continue
        problem = _problem(schema, entry)
        known = merged.get(problem.key)
        if known is None:
            merged[problem.key] = problem
        elif problem.expected not in known.expected:
            number = isinstance(entry["input"], int | float)  # out of its bounds, as it would be in a list
            also = problem.expected.partition("; did you mean")[0] if number else problem.expected
            merged[problem.key] = Problem(problem.key, known.got, f"{known.expected} or {also}")
    steps = [key.split(".") for key in merged]
    parents = {".".join(path[:depth]) for path in steps for depth in range(1, len(path))}
    rest = (
        [Problem("scene", f"{len(entries) - MOST} further mistakes", "those above corrected first")]
        if len(entries) > MOST
        else []
    )
    return [problem for key, problem in merged.items() if key not in parents] + rest


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


def follows_from_another(entry: Any) -> bool:
    """Whether a list counts as too short only because items in it are wrong."""
    return entry["type"] == "too_short" and len(entry["input"]) >= entry["ctx"]["min_length"]


def _problem(schema: type[BaseModel], entry: Any) -> Problem:
    kind, context = entry["type"], entry.get("ctx", {})
    key = printable(".".join(str(step) for step in entry["loc"] if not _is_branch(step))) or "scene"
    if kind == "extra_forbidden":
        return Problem(key, "an unknown key", _known_keys(schema, entry["loc"]))
    if kind == "missing":
        return Problem(key, "nothing", f"{_needed(schema, entry['loc'], key)}: this key is required")
    if kind == "union_tag_not_found":
        return Problem(
            f"{key}.kind", "nothing", f"one of {', '.join(_kinds(schema, entry['loc']))}: this key is required"
        )
    if kind == "union_tag_invalid":
        expected = context["expected_tags"]
        hint = hint_at(str(context["tag"])[:LONGEST_SHOWN], re.findall(r"'([^']*)'", expected))
        return Problem(f"{key}.kind", repr(context["tag"])[:LONGEST_SHOWN], f"one of {expected}{hint}")
    got = repr(entry["input"])[:LONGEST_SHOWN]
    hint = suggest(kind, entry["input"], _unit_of(schema, entry["loc"]))
    if kind == "literal_error":
        hint = hint_at(str(entry["input"])[:LONGEST_SHOWN], re.findall(r"'([^']*)'", context["expected"]))
    return Problem(key, got, _expected(kind, context, entry["msg"]) + hint)


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


def _unit_of(schema: type[BaseModel], location: Sequence[Any]) -> str | None:
    """The unit that a key states; of a number in a list, that of the list."""
    path = [step for step in location if isinstance(step, str) and not _is_branch(step)]
    for table in _tables(schema, path) if path else ():
        unit = table.units().get(path[-1]) if issubclass(table, Table) else None
        if unit:
            return unit
    return None


def _needed(schema: type[BaseModel], location: Sequence[Any], key: str) -> str:
    """What a key that is not there must hold."""
    annotations = [_annotation(table, str(location[-1])) for table in _tables(schema, location)]
    unit, kinds = _unit_of(schema, location), _kinds(schema, location)
    if not any(model for annotation in annotations for model in _models(annotation)):
        choices = [
            str(one) for annotation in annotations if get_origin(annotation) is Literal for one in get_args(annotation)
        ]
        return " or ".join(choices) or (f"a value in {unit}" if unit else "a value")
    if any(get_origin(annotation) is tuple for annotation in annotations):
        return f"a list of tables, [[{key}]] or {key.rpartition('.')[2]} = [{{ ... }}]"
    return f"a table [{key}]" + (f" with kind = {' or '.join(kinds)}" if kinds else "")


def _kinds(schema: type[BaseModel], location: Sequence[Any]) -> list[str]:
    """The kinds of the tables that the last key of a location may hold, in quotes."""
    annotations = [_annotation(table, str(location[-1])) for table in _tables(schema, location)]
    models = [model for annotation in annotations for model in _models(annotation) if "kind" in model.model_fields]
    return [f'"{kind}"' for model in models for kind in get_args(model.model_fields["kind"].annotation)]


def _known_keys(schema: type[BaseModel], location: Sequence[Any]) -> str:
    """The keys that a table may hold, the likeliest first."""
    tables = _tables(schema, location)
    keys = sorted({field.alias or name for table in tables for name, field in table.model_fields.items()})
    return f"one of {', '.join(keys)}{hint_at(str(location[-1]), keys)}" if keys else "an empty table"


def _tables(schema: type[BaseModel], location: Sequence[Any]) -> list[type[BaseModel]]:
    """The tables in which the last key of a location may stand."""
    tables: list[type[BaseModel]] = [schema]
    for step in location[:-1]:
        if isinstance(step, str) and not _is_tag(step, tables):
            tables = [model for table in tables for model in _models(_annotation(table, step))]
        elif isinstance(step, str):
            tables = [table for table in tables if step in get_args(table.model_fields["kind"].annotation)]
    return tables


def _annotation(table: type[BaseModel], key: str) -> Any:
    found = (field.annotation for name, field in table.model_fields.items() if key in (name, field.alias))
    return next(found, None)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables that an annotation allows, inside lists and unions too."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield effects_table() if annotation is Effects else annotation
    for part in get_args(annotation):
        yield from _models(part)


def _is_tag(step: str, tables: Sequence[type[BaseModel]]) -> bool:
    """Whether a step names a branch of a union by its `kind`."""
    return any("kind" in t.model_fields and step in get_args(t.model_fields["kind"].annotation) for t in tables)


def _is_branch(step: object) -> bool:
    """Whether a step of pydantic's location names a branch of a union, not a key of the file."""
    motions = ("harmonic", "rotation", "fourier", "point-to-point", "table", "log", "tip-path", "circle", "polyline")
    others = ("pd", "pid", "low-pass", "notch", "float", "constrained-float")
    return isinstance(step, str) and (step in (*motions, *others) or "[" in step)
