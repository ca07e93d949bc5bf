"""TOML text as plain data, in a time that does not depend on how its keys are nested or how long its numbers are."""

import re
import tomllib
from collections.abc import Iterator
from typing import Any

DEEPEST = 32
"""Tables and lists in each other; a scene needs five."""
NOT_KEYS = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL)
"""Strings, quoted keys and comments of TOML."""
LONGEST_NUMBER = 400
"""Characters of a number; Python itself refuses whole numbers of more than 4,300 digits, and takes time by the square of these."""
ENDLESS_NUMBER = re.compile(rf"(?<![\w.+-])[+-]?\d[\w.+-]{{{LONGEST_NUMBER},}}")
WHOLE_NUMBERS = 2**63
"""A whole number of TOML has 64 bits."""
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


def list_endless_numbers(raw: Any, path: str = "") -> Iterator[str]:
    """The dotted paths of whole numbers that no 64 bits hold; most of them no floating-point number holds either."""
    if isinstance(raw, int) and not -WHOLE_NUMBERS <= raw < WHOLE_NUMBERS:
        yield path
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, (list, tuple)) else ()
    for step, child in items:
        yield from list_endless_numbers(child, f"{path}.{step}" if path else str(step))
