"""How well the numbers of a scene are known."""

from typing import Annotated, Any

from flexlin.errors import ArgumentError, Problem
from flexlin.scene.base import Number, Table, Unit
from flexlin.scene.parameters import get_value
from flexlin.text import printable

MOST = 12
"""Uncertain numbers of one scene: the search tries combinations of them."""


class Uncertain(Table):
    """A number of the scene lies between two ends, its own value among them; in the unit of that number."""

    low: Annotated[Number, Unit("of that number")]
    """Least value."""
    high: Annotated[Number, Unit("of that number")]
    """Largest value."""


def uncertainty_problems(scene: Any) -> list[Problem]:
    """Say which keys of [uncertainty] lead to no real number, and which ends are the wrong way round."""
    problems = []
    if len(scene.uncertainty) > MOST:
        problems.append(Problem("uncertainty", f"{len(scene.uncertainty)} numbers", f"{MOST} at most"))
    for path, ends in scene.uncertainty.items():
        key = f'uncertainty."{printable(path)}"'
        try:
            own = get_value(scene, path)
        except ArgumentError as error:
            problems.append(
                Problem(key, f"nothing at {printable(str(error.got))}", error.expected or "a key of the scene")
            )
            continue
        if not isinstance(own, float):
            problems.append(Problem(key, "no real number there", "the path of one, such as effects.payload.mass"))
        elif not ends.low < ends.high:
            problems.append(Problem(key, f"{ends.low:g} to {ends.high:g}", "low below high"))
    return problems
