"""Checks at the boundary: shape, finite, range; made once, where a value comes in."""

import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from contextvars import ContextVar
from math import isfinite
from operator import index
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexlin.bounds import MEMORY_LIMIT
from flexlin.context import holding
from flexlin.errors import ArgumentError, FlexlinError, TimeLimit, TooLarge

Array = NDArray[Any]
Answer = TypeVar("Answer")
SAMPLES = 256
"""Equally spaced times of a period at which something smooth is looked at, or listed."""
SUM_ROUNDING = 1e-12
"""A share of the largest, below which what is left of a sum is rounding."""
_limit: ContextVar[int] = ContextVar("limit", default=MEMORY_LIMIT)


def real_array(name: str, value: ArrayLike, shape: Sequence[int | None] | None = None) -> Array:
    """Return `value` as a finite float array of the given shape (None: any length on that axis)."""
    array = value if type(value) is np.ndarray and value.dtype == np.float64 else as_floats(name, value)
    if shape is not None:
        have = array.shape
        if len(have) != len(shape) or (
            have != shape and any(want not in (None, got) for want, got in zip(shape, have, strict=True))
        ):
            wanted = "(" + ", ".join("any" if want is None else str(want) for want in shape) + ")"
            raise ArgumentError(f"{name} has the wrong shape", got=have, expected=wanted)
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        place = f" at index {where}" if where else ""
        raise ArgumentError(f"{name} is not finite", got=f"{array[where]}{place}", expected="finite numbers")
    return array


def as_floats(name: str, value: ArrayLike) -> Array:
    """Return `value` as an array of floats."""
    try:
        given = np.asarray(value)
        array = given if np.iscomplexobj(given) else given.astype(float, copy=False)
    except (TypeError, ValueError):
        raise ArgumentError(f"{name} is not numeric", got=repr(value)[:80], expected="real numbers") from None
    if np.iscomplexobj(array):
        raise ArgumentError(f"{name} is complex", got=str(array.dtype), expected="real numbers")
    return array


def positive(name: str, value: float) -> float:
    """Return `value` as a finite float greater than zero."""
    number = value if type(value) is float and isfinite(value) else float(real_array(name, value, ()))
    if number <= 0:
        raise ArgumentError(f"{name} is not positive", got=number, expected="a number greater than 0")
    return number


def whole(name: str, value: object, least: int = 1) -> int:
    """Return `value` as a whole number from `least` on; True, 2.0 and "2" are none."""
    try:
        number = None if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        number = None
    if number is None or number < least:
        raise ArgumentError(f"{name} does not fit", got=repr(value)[:80], expected=f"a whole number from {least} on")
    return number


def c_name(value: str) -> str:
    """Return a name that C functions and files may bear: letters, digits and _, no digit first."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,60}", value):
        expected = "letters, digits and _, no digit first, 61 at most"
        raise ArgumentError("name is none that a C function can bear", got=repr(value)[:80], expected=expected)
    return value


def times(t: ArrayLike) -> Array:
    """Return `t` as a finite array of shape (N,)."""
    return real_array("t", t, (None,))


def at_times(evaluate: Callable[[Array], Array], t: ArrayLike) -> Array:
    """Evaluate a function of times (N,) -> (N, ...) at an array of times, or at one time, whose value comes without the first axis."""
    given = np.asarray(t)
    return evaluate(times(given)) if given.ndim else evaluate(times(given[None]))[0]


def memory_limit(size: float) -> AbstractContextManager[None]:
    """Let `check_size` refuse what takes more than `size` bytes, within the block and in this thread."""
    return holding(_limit, int(positive("the limit of memory", size)))


def try_to(work: Callable[[], Answer]) -> Answer | FlexlinError | np.linalg.LinAlgError:
    """What work gives, or why it gives nothing. Raises: TimeLimit, which ends more than this work."""
    try:
        return work()
    except TimeLimit:
        raise
    except (FlexlinError, np.linalg.LinAlgError) as error:
        return error


def bytes_allowed() -> int:
    """How many bytes one piece of work may take."""
    return _limit.get()


def check_size(what: str, size: int, todo: str) -> None:
    """Refuse a request of unreasonable size before anything is allocated."""
    limit = bytes_allowed()
    if size > limit:
        raise TooLarge(f"{what} is too large", got=f"{size:,} bytes", expected=f"at most {limit:,} bytes", todo=todo)
