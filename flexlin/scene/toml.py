"""TOML text as plain data, in a time that does not depend on nesting or on the length of numbers; plain data as TOML text."""

import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from flexlin.bounds import DEEPEST, LONGEST_NUMBER

NOT_KEYS = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL)
"""Strings, quoted keys and comments of TOML."""
ENDLESS_NUMBER = re.compile(rf"(?<![\w.+-])[+-]?\d[\w.+-]{{{LONGEST_NUMBER},}}")
ENDLESS_KEY = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{DEEPEST},}}[ \t]*[]=]")


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML, but no dotted key of more than `DEEPEST` steps: Python's reader takes time by the square of the steps.

    Raises: TOMLDecodeError, also for a number without end; RecursionError for tables in tables without end.
    """
    bare = NOT_KEYS.sub("s", text)
    if ENDLESS_KEY.search(bare) is not None:
        raise RecursionError
    if ENDLESS_NUMBER.search(bare) is not None:
        raise tomllib.TOMLDecodeError(f"a number of more than {LONGEST_NUMBER} characters")
    return tomllib.loads(text)


FAULTS = {
    "Illegal character '\\n'": "a closing quote",
    "Unterminated string": "a closing quote",
    'Expected "\'"': "a closing quote",
    "Invalid value": "a number, a text in quotes, true, false, [ ] or { } behind =",
    "Expected newline": "the end of the line behind one value; texts stand in quotes",
    "Expected '='": "key = value",
    "Expected ']": "a closing bracket",
    "Unclosed array": "a comma, or a closing bracket before it",
    "Unclosed inline table": "a comma, or a closing brace on the same line",
    "Cannot overwrite": "each key once",
    "Cannot declare": "each table once",
}
"""What is missing where Python's reader of TOML says so."""


def explain_fault(text: str, error: tomllib.TOMLDecodeError) -> tuple[str, str]:
    """Of a text that is no TOML: the line at fault, and what was expected there."""
    said, lines = str(error), text.splitlines() or [""]
    place = re.search(r"\(at line (\d+), column \d+\)$", said)
    if place is None and "end of document" not in said:
        return said, "a readable TOML file"
    number = min(int(place[1]), len(lines)) if place else len(lines)
    expected = next(
        (words for start, words in FAULTS.items() if said.startswith(start)), f"TOML: {said.partition(' (')[0]}"
    )
    return f"{lines[number - 1].strip()} in line {number}", expected


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
    below = {key: value for key, value in given.items() if is_table(value) or is_list_of_tables(value)}
    for key, value in given.items():
        if key not in below:
            yield with_note(f"{write_key(key)} = {write_value(value)}", note((*path, key)))
    for key, value in below.items():
        name = ".".join(map(write_key, (*path, key)))
        for child in [value] if is_table(value) else value:
            yield ""
            yield with_note(f"[{name}]" if is_table(value) else f"[[{name}]]", note((*path, key)))
            yield from list_lines(child, (*path, key), note)


def with_note(line: str, note: str) -> str:
    """A line with a comment behind it."""
    return f"{line:<36} # {note}" if note else line


def is_table(value: Any) -> bool:
    """Whether a value is a table."""
    return isinstance(value, Mapping)


def is_list_of_tables(value: Any) -> bool:
    """Whether a value is a list of tables, which has headings of its own."""
    return isinstance(value, list | tuple) and len(value) > 0 and all(map(is_table, value))


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
