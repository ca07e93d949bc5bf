"""Plain data as TOML text."""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

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
