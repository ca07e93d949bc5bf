"""Every public function with valid arguments, and twenty kinds of nonsense for the place of each."""

import math
import warnings
from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.analyses import Budget, limited
from flexlin.errors import FlexlinError
from flexlin.scene import Accuracy
from tests.torture.trial import Row
from tests.torture.valid_calls import valid_calls

LONGEST = 60.0
"""Seconds that a call may take: what is asked for is nonsense."""
NONSENSE = (
    None, True, "motion", "", b"1", -1, 0, 1.5, math.nan, math.inf, 1e300, 10**30, 1j, [], {}, [[1, 2], [3]],
    np.array(["a", "b"]), np.full((2, 2), math.nan), object(), lambda: 1.0, lambda *_: "word", {1, "a"},
)  # fmt: skip


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
    """Each function, each argument: `count` kinds of nonsense, others for each place."""
    row = Row("misuse")
    for at, (name, (function, arguments)) in enumerate(valid_calls().items()):
        if (plain := outcome(function, arguments)) != "answered":
            row.wrong.append(f"{name} does not work as it should: {plain}")
        for place, argument in enumerate(arguments):
            for k in range(count):
                value = NONSENSE[(number + 7 * at + 3 * place + 5 * k) % len(NONSENSE)]
                with chdir(out):  # nonsense may be the name of a file
                    found = outcome(function, {**arguments, argument: value})
                row.runs += 1
                row.answered += found == "answered"
                if found not in ("answered", "refused"):
                    row.blame("uncaught", f"{name}({argument} = {value!r:.40}): {found}")
    return row
