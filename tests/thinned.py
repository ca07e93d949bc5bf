"""Many cases of one kind: a few run with the quick tests, the others with the slow ones."""

from collections.abc import Iterable
from typing import Any

import pytest


def thin(cases: Iterable[Any], quick: int = 1) -> list[Any]:
    """The cases of a parametrized test, all but the first few of them marked slow."""
    return [
        case if i < quick else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow)
        for i, case in enumerate(cases)
    ]
