"""Times that a resolution will ask for, sampled in one call: a small call of a compiled function costs as much as a hundred times in it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.resolved.sampling import CHUNK


@dataclass(frozen=True, eq=False)
class Foreseen:
    """A function of times (N,) -> (N, ...) that knows its values at some arrays of times already, one after another in `values`."""

    function: Callable[[Array], Array]
    parts: tuple[Array, ...]
    values: Array

    def __call__(self, t: Array) -> Array:
        end = 0
        for times in self.parts:
            end += len(times)
            if len(times) == len(t) and (times == t).all():
                return self.values[end - len(times) : end]
        return self.function(t)


def foresee(function: Callable[[Array], Array], entries: int, parts: list[Array]) -> Callable[[Array], Array]:
    """The function with its values at the times of all parts, where they are few; as it is where it does not serve all of them at once.

    Parameters: entries: of a value. What goes wrong here goes wrong again where the times are asked for, and is named there.
    """
    t = np.concatenate(parts)
    if 8 * entries * len(t) > CHUNK:
        return function
    try:
        values = function(t)
    except (ValueError, IndexError, ArithmeticError):
        return function
    if not isinstance(values, np.ndarray) or values.ndim != 3 or len(values) != len(t):
        return function
    return Foreseen(function, tuple(parts), values)
