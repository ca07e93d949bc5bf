"""Every public function with valid arguments, and twenty kinds of nonsense for the place of each."""

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.answers import Budget, limited
from flexlin.errors import FlexlinError
from flexlin.scene import Accuracy
from tests.torture.rows import Row
from tests.torture.valid_calls import valid_calls

LONGEST = 60.0
"""Seconds that a call may take: what is asked for is nonsense."""
NONSENSE: dict[str, Any] = {
    "None": None,
    "True": True,
    "a text": "motion",
    "no text": "",
    "bytes": b"1",
    "-1": -1,
    "0": 0,
    "1.5": 1.5,
    "nan": math.nan,
    "inf": math.inf,
    "1e300": 1e300,
    "10**30": 10**30,
    "1j": 1j,
    "[]": [],
    "{}": {},
    "a ragged list": [[1, 2], [3]],
    "words": np.array(["a", "b"]),
    "an array of nan": np.full((2, 2), math.nan),
    "an object": object(),
    "a function of nothing": lambda: 1.0,
    "a function of words": lambda *_: "word",
    "a set": {1, "a"},
}


def misuses(name: str, kinds: Callable[[int], list[str]]) -> Iterator[tuple[str, str, str]]:
    """Put nonsense of some kinds in the place of each argument: gives argument, kind, and what came out."""
    function, arguments = valid_calls()[name]
    for number, place in enumerate(arguments):
        for kind in kinds(number):
            yield place, kind, outcome(function, {**arguments, place: NONSENSE[kind]})


def outcome(function: Callable, arguments: dict[str, Any]) -> str:
    """ "answered", "refused", or what untyped error came through."""
    try:
        with warnings.catch_warnings(), limited("the call", Budget().allow("the call", Accuracy(seconds=LONGEST))):
            warnings.simplefilter("ignore")
            function(**arguments)
    except FlexlinError:
        return "refused"
    except Exception as fault:
        return f"{type(fault).__name__}: {str(fault)[:100]}"
    return "answered"


def misuse(count: int, number: int, out: Path) -> Row:
    """Each function, each argument: `count` kinds of nonsense, another choice for each."""
    row, kinds = Row("misuse"), list(NONSENSE)
    for place, name in enumerate(valid_calls()):
        function, arguments = valid_calls()[name]
        if (plain := outcome(function, arguments)) != "answered":
            row.wrong.append(f"{name} does not work as it should: {plain}")
        chosen = partial(choose, kinds, count, number + 7 * place)
        with chdir(out):  # nonsense may be the name of a file
            tried = list(misuses(name, chosen))
        for argument, kind, found in tried:
            row.runs += 1
            row.answered += found == "answered"
            if found not in ("answered", "refused"):
                row.uncaught += 1
                row.wrong.append(f"{name}({argument} = {kind}): {found}")
    return row


def choose(kinds: list[str], count: int, start: int, place: int) -> list[str]:
    """Some of the kinds, others for each place."""
    return [kinds[(start + 3 * place + 5 * k) % len(kinds)] for k in range(min(count, len(kinds)))]
