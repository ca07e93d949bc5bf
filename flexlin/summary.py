"""A short repr for results: names, shapes and numbers instead of every entry of every array."""

from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from numbers import Complex, Integral, Real
from textwrap import wrap
from typing import Any, dataclass_transform

WIDTH, MOST_LINES = 110, 12
"""Columns and lines of a summary."""
FULL_ENTRIES = 6
"""Entries of an array or a tuple that are shown in full."""


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def immutable(made: Any = None, **how: bool) -> Any:
    """Make a class a frozen dataclass with a repr by `represent`; how: as `dataclass` takes it, such as eq=False."""
    if made is None:
        return partial(immutable, **how)
    made.__repr__ = represent
    return dataclass(frozen=True, **how)(made)


def represent(result: Any) -> str:
    """Return a repr of a dataclass in at most 12 lines of 110 columns.

    Numbers are shown with six digits, arrays of more than six entries by kind and shape, other objects by the name of their class.
    """
    name = type(result).__name__
    parts = [f"{field.name}={represent_value(getattr(result, field.name))}" for field in fields(result) if field.repr]
    line = f"{name}({', '.join(parts)})"
    if len(line) <= WIDTH:
        return line
    lines = pack(parts)
    if len(lines) > MOST_LINES - 2:
        lines = [*lines[: MOST_LINES - 3], "    ..."]
    return "\n".join([f"{name}(", *lines, ")"])


def pack(parts: list[str]) -> list[str]:
    """Return the fields in as few indented lines as hold them, broken between fields where that is possible."""
    lines = [""]
    for part in (*(f"{part}," for part in parts[:-1]), *parts[-1:]):
        joined = f"{lines[-1]} {part}" if lines[-1] else part
        lines = [*lines[:-1], joined] if len(joined) <= WIDTH - 4 else [*lines, part]
    return [f"    {piece}" for line in lines if line for piece in wrap(line, WIDTH - 4, break_on_hyphens=False)]


def represent_value(value: Any) -> str:
    """Return one field in short."""
    if value is None or isinstance(value, bool):
        return repr(value)
    if isinstance(value, str):
        return repr(value if len(value) <= 80 else value[:77] + "...")
    if isinstance(value, Complex) and not hasattr(value, "shape"):
        return represent_number(value)
    if hasattr(value, "shape"):
        return represent_array(value)
    if isinstance(value, tuple | list | dict):
        return represent_collection(value)
    if is_dataclass(value) or not isinstance(value, type):
        return f"<{type(value).__name__}>"
    return f"<class {value.__name__}>"


def represent_number(value: Any) -> str:
    """Return a number with six digits; a subclass of float, such as a radius, is shown as the number that it is."""
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        return f"{float(value):.6g}"
    return f"{complex(value):.6g}"


def represent_array(value: Any) -> str:
    """Return a small vector in full, and any other array or expression by kind and shape."""
    shape = tuple(value.shape)
    kind = getattr(value, "dtype", None)
    if kind is None:
        return f"<{type(value).__name__} {shape}>"
    if kind.kind in "fiuc" and len(shape) <= 1 and value.size <= FULL_ENTRIES:
        entries = [represent_number(entry) for entry in value.tolist()] if shape else [represent_number(value.item())]
        return f"[{', '.join(entries)}]" if shape else entries[0]
    return f"<{kind} {shape}>"


def represent_collection(value: Any) -> str:
    """Return a few plain entries in full, and any other collection by length and kind of its entries."""
    entries = list(value.values()) if isinstance(value, dict) else list(value)
    plain = all(entry is None or isinstance(entry, bool | int | float | complex | str) for entry in entries)
    if not entries or (len(entries) <= FULL_ENTRIES and plain and not isinstance(value, dict)):
        inside = ", ".join(represent_value(entry) for entry in entries)
        if isinstance(value, tuple):
            return f"({inside},)" if len(entries) == 1 else f"({inside})"
        return f"[{inside}]" if isinstance(value, list) else "{}"
    kinds = sorted({type(entry).__name__ for entry in entries})
    return f"<{len(entries)} {' or '.join(kinds[:3])}>"
