"""The one door for what somebody else wrote, in TOML, URDF, CSV, JSON, --set or Python: bounds of files, digits, sizes and depths."""

import math
import os
import re
import stat
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from unicodedata import category

MEBIBYTE = 2**20
LARGEST_SCENE, LARGEST_ROBOT = MEBIBYTE, 4 * MEBIBYTE
"""Bytes of a scene, and of a URDF file."""
LARGEST_TABLE = LARGEST_MANIFEST = 64 * MEBIBYTE
"""Bytes of a table of a motion, and of a list of results."""
LARGEST_LOG = 1024 * MEBIBYTE
"""Bytes of a log."""
MEMORY_LIMIT = 1024 * MEBIBYTE
"""Bytes that one request may take unless `checks.memory_limit` says otherwise."""
MOST_ROWS, MOST_COLUMNS, MOST_ELEMENTS, MOST_ITEMS = 2**18, 1000, 50_000, 200
"""Rows of a table, columns of a log, elements of a URDF file, and links, designs, or described mistakes, of one scene."""
DEEPEST_NESTING = 32
"""Tables, lists or elements in each other; a scene needs five."""
SHALLOW = f"at most {DEEPEST_NESTING} tables and lists in each other"
LONGEST_SHOWN, MOST_NAMED = 60, 4
"""Characters of a value that are repeated in a message, and keys that it names."""
LONGEST_NUMBER = 400
"""Characters of a number; Python itself refuses whole numbers of more than 4,300 digits, and takes time by the square of these."""
LARGEST_NUMBER = 1e30
"""No number of an arm is larger; squares and cubes of it stay far from overflow."""
SMALLEST_NUMBER = 1e-30
"""A figure of an arm that is smaller must be zero; quotients and powers then stay numbers."""
IN_RANGE = f"a number from {-LARGEST_NUMBER:g} to {LARGEST_NUMBER:g}"
WHOLE_IN_RANGE = "a number between -2^63 and 2^63, or one with a decimal point"


def read_text(path: Path, most: int) -> str:
    """Read a text file in UTF-8, with or without a byte order mark.

    A pipe or device is refused before it is opened, since it may never end.

    Parameters: most: bytes that it may have.
    Raises: OSError saying what is wrong with the file.
    """
    refuse_odd(path.stat(), most)
    with path.open("rb") as file:
        refuse_odd(os.fstat(file.fileno()), most)  # another one may have come in its place
        content = file.read(most + 1)
    if len(content) > most:  # files of the system itself state no size
        raise OSError(f"more than {most:,} bytes")
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise OSError(f"{NO_TEXT}, from byte {error.start} on") from None


NO_TEXT = "bytes that are no text in UTF-8"
"""What a person reads in place of a codec's own words."""


def refuse_odd(about: os.stat_result, most: int) -> None:
    """Refuse what is no regular file, or too large."""
    if not stat.S_ISREG(about.st_mode):
        raise OSError("no regular file")
    if about.st_size > most:
        raise OSError(f"{about.st_size:,} bytes, more than {most:,}")


def read_number(text: str) -> float:
    """A number as somebody wrote it. Raises: ValueError with what was expected."""
    value = math.nan
    if len(text) <= LONGEST_NUMBER:
        with suppress(ValueError):
            value = float(text)
    if not abs(value) <= LARGEST_NUMBER:
        raise ValueError(IN_RANGE)
    return value


NOT_KEYS = re.compile(r'"""(?:\\.|[^\\])*?"""|\'\'\'.*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*', re.DOTALL)
"""Strings, quoted keys and comments of TOML."""
ENDLESS_NUMBER = re.compile(rf"(?<![\w.+-])[+-]?\d[\w.+-]{{{LONGEST_NUMBER},}}")
ENDLESS_KEY = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{DEEPEST_NESTING},}}[ \t]*[]=]")


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML, but no dotted key of more than `DEEPEST_NESTING` steps: Python's reader takes time by the square of the steps.

    Raises: TOMLDecodeError, also for a number without end; RecursionError for tables in tables without end.
    """
    bare = NOT_KEYS.sub("s", text)
    if ENDLESS_KEY.search(bare) is not None:
        raise RecursionError
    if ENDLESS_NUMBER.search(bare) is not None:
        raise tomllib.TOMLDecodeError(f"a number of more than {LONGEST_NUMBER} characters")
    return tomllib.loads(text)


def list_excesses(raw: Any) -> Iterator[tuple[str, str, str]]:
    """What plain data hold beyond the bounds: path, what was got, what was expected; what they mean is for a schema to judge."""
    if is_too_deep(raw):
        yield "scene", "tables in tables without end", SHALLOW
    else:
        yield from ((path, "a whole number beyond 64 bits", WHOLE_IN_RANGE) for path in list_endless_numbers(raw, ""))


def is_too_deep(raw: Any) -> bool:
    """Whether plain data hold more than `DEEPEST_NESTING` tables and lists in each other; looks no further than that."""
    level = [raw]
    for _ in range(DEEPEST_NESTING):
        inner = (node.values() if isinstance(node, dict) else node for node in level)
        level = [child for nodes in inner for child in nodes if isinstance(child, (dict, list, tuple))]
        if not level:
            return False
    return True


def list_endless_numbers(raw: Any, path: str) -> Iterator[str]:
    """The dotted paths of whole numbers that no 64 bits hold; most of them no floating-point number holds either."""
    if isinstance(raw, int) and not -(2**63) <= raw < 2**63:
        yield path
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, (list, tuple)) else ()
    for step, child in items:
        yield from list_endless_numbers(child, f"{path}.{step}" if path else str(step))


JOINERS = "\u200c\u200d"
"""Format characters that some scripts spell with."""


def printable(text: object, longest: int = 200) -> str:
    """Text that a terminal shows as it stands: control characters escaped, the middle of a long text left out."""
    whole = str(text)
    ends = whole if len(whole) <= 2 * longest else whole[:longest] + whole[-longest:]
    shown = "".join(c.encode("unicode_escape").decode() if steers(c) else c for c in ends)
    half = longest // 2 - 2
    return shown if len(shown) <= longest else f"{shown[:half]} ... {shown[-half:]}"


def hint_at(word: str, known: Iterable[str], alike: float = 0.6) -> str:
    """What a message says behind the words that are known, where one of these is like a word that is not."""
    from difflib import get_close_matches  # 6 ms, which only a mistake needs

    close = get_close_matches(word, known, n=1, cutoff=alike)
    return f"; did you mean {close[0]!r}?" if close else ""


def steers(character: str) -> bool:
    """Whether a character is no part of a line of text: controls, line ends, changes of direction, halves of a pair."""
    return category(character) in ("Cc", "Cf", "Cs", "Zl", "Zp") and character not in JOINERS
