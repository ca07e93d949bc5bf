"""TOML text as plain data, in a time that does not depend on how its keys are nested."""

import re
import tomllib
from typing import Any

DEEPEST = 32
"""Tables and lists in each other; a scene needs five."""
NOT_KEYS = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL)
"""Strings, quoted keys and comments of TOML."""
ENDLESS_KEY = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{DEEPEST},}}[ \t]*[]=]")


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML, but no dotted key of more than `DEEPEST` steps: Python's reader takes time by the square of the steps.

    Raises: TOMLDecodeError; RecursionError for tables in tables without end.
    """
    if ENDLESS_KEY.search(NOT_KEYS.sub("s", text)) is not None:
        raise RecursionError
    return tomllib.loads(text)
