"""What a writer probably meant by a value of the wrong kind: a list, or a quantity with a unit."""

import re
from math import isfinite
from typing import Any

from flexlin.scene.units import dimension_of, read_quantity

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
NUMBERS = re.compile(rf"\s*[\[(]?\s*({NUMBER}(?:[\s,;]+{NUMBER})*)\s*[,;]?\s*[\])]?\s*")
LONGEST = 200
"""Characters of a text that is looked at."""


def suggest(kind: str, value: Any, unit: str | None) -> str:
    """Words for what was meant, to stand behind what was expected; empty where there is no guess.

    kind: pydantic's name of what is wrong; unit: of the key, where it states one.
    """
    if kind == "tuple_type":
        return suggest_list(value)
    if kind in ("float_type", "int_type") and isinstance(value, str) and len(value) <= LONGEST:
        return suggest_number(value, unit)
    if kind in ("float_type", "int_type") and isinstance(value, list | tuple) and len(value) == 1:
        return f"; did you mean {value[0]!r}?" if isinstance(value[0], int | float) else ""
    return ""


def suggest_list(value: Any) -> str:
    """A list of the numbers in a text or of a single number: 5,2 may mean [5, 2]."""
    if isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value):
        return f"; did you mean [{value}]?"
    found = NUMBERS.fullmatch(value) if isinstance(value, str) and len(value) <= LONGEST else None
    if found is None:
        return ""
    numbers = re.findall(NUMBER, found.group(1))
    return f"; did you mean [{', '.join(numbers)}]?"


def suggest_number(value: str, unit: str | None) -> str:
    """The SI value of a quantity with a unit: 96 cm may mean 0.96."""
    try:
        found = read_quantity(value)
        fits = not unit or found.dimension in (None, *(dimension_of(part)[1] for part in unit.split(" or ")))
    except ValueError:
        return f" in {unit}, without a unit behind it" if unit and re.match(rf"\s*{NUMBER}\s*\D", value) else ""
    if not fits:
        return f" in {unit}"
    return f"; did you mean {found.value:.12g}? Numbers are in {unit or 'SI units'}"
