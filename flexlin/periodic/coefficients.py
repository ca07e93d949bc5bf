"""Coefficients as functions of time: constants, feedback loops and state matrices, all of which pickle, and their checks."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, at_times, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.grid import NAMED, golden

MatrixFunction = Callable[[Array], Array]
"""Times (N,) -> (N, rows, columns)."""
PROBES = golden(np.arange(3))
"""Where in a period a coefficient is looked at before it is used."""


@dataclass(frozen=True, eq=False)
class Constant:
    """A constant value as a function of time: (N,) -> (N, *value.shape), without copies."""

    value: Array

    def __call__(self, t: ArrayLike) -> Array:
        return np.broadcast_to(self.value, (*np.shape(t), *self.value.shape))


def has_nothing_narrow(coefficient: Callable[..., Any]) -> bool:
    """Whether a coefficient changes fast at the breaks and features of its system alone, where these are complete.

    So it is with constants, with series of few waves, and with functions of the motion that say so: `complete` is true. Any other may
    hold a pulse of its own, and is looked at everywhere.
    """
    if isinstance(coefficient, Constant):
        return True
    if isinstance(coefficient, FourierSeries):
        return 2 * coefficient.degree <= NAMED
    if isinstance(coefficient, ChebyshevPanels):
        return 2 * coefficient.coefficients.shape[1] <= NAMED
    return bool(getattr(coefficient, "complete", False))


@dataclass(frozen=True, eq=False)
class Combined:
    """A function of time made of others, rule(f(t), g(t) ...); `complete`: as of `has_nothing_narrow`."""

    rule: Callable[..., Array]
    parts: tuple[Callable[[Array], Array], ...]
    complete: bool = False

    def __call__(self, t: Array) -> Array:
        return self.rule(*(part(t) for part in self.parts))


def combine(rule: Callable[..., Array], *parts: Callable[[Array], Array]) -> Combined:
    """What a rule makes of functions of time at each time, as complete as all of them."""
    return Combined(rule, parts, all(map(has_nothing_narrow, parts)))


@dataclass(frozen=True)
class ClosedLoop:
    """A(t) - B(t) K(t); plant: the system of A and B."""

    A: MatrixFunction
    B: MatrixFunction
    K: MatrixFunction
    plant: Any = None

    def __call__(self, t: ArrayLike) -> Array:
        return at_times(lambda t: self.A(t) - self.B(t) @ self.K(t), t)


def varies(coefficient: MatrixFunction, period: float) -> bool:
    """Whether a coefficient is more than one matrix that is handed out at all times."""
    return not isinstance(coefficient, Constant) and bool(coefficient(period * PROBES).strides[0] != 0)


def as_matrix_function(name: str, value: MatrixFunction | ArrayLike) -> MatrixFunction:
    """Let a constant matrix stand where a function of time is wanted."""
    return value if callable(value) else Constant(real_array(name, value, (None, None)))


def refuse_signature(name: str, function: Callable[..., Any]) -> None:
    """Refuse a function that cannot be called with times alone."""
    try:
        inspect.signature(function).bind(PROBES)
    except TypeError as error:
        raise ArgumentError(
            f"{name} is no function of times", got=str(error), expected="a function of t (N,)"
        ) from None
    except ValueError:  # compiled functions do not say what they take
        return


def check_samples(name: str, function: MatrixFunction, period: float) -> Array:
    """Sample a coefficient at a few times, a constant at one, and return the checked (N, rows, columns).

    Raises: ArgumentError when a value is no array or not finite (naming the time), or when the shape depends on the times.
    """
    if isinstance(function, Constant):
        return function.value[None]
    t = period * PROBES
    values = check_finite(name, check_array(name, sample_together(name, function, t), t), t)
    alone = check_array(name, function(t[:1]), t[:1])
    if alone.shape[1:] != values.shape[1:]:
        raise ArgumentError(
            f"{name}(t) changes its shape",
            got=f"{alone.shape} for one time, {values.shape} for {len(t)}",
            expected="(N, rows, columns) for t of shape (N,)",
        )
    return values


def sample_together(name: str, function: MatrixFunction, t: Array) -> Any:
    """Call a coefficient with several times at once; refuse one that was written for a single time."""
    try:
        values = function(t)
    except (ValueError, TypeError, IndexError):
        refuse_signature(name, function)
        if not takes_one_time(function, t):
            raise
    else:
        if (np.ndim(values) == 3 and len(values) == len(t)) or not takes_one_time(function, t):
            return values
    raise ArgumentError(
        f"{name}(t) takes a single time",
        got="a matrix for one time, none for each of several",
        expected=f"({len(t)}, rows, columns) for t of shape ({len(t)},)",
        todo=f"give lambda times: numpy.array([{name}(t) for t in times]), or let {name} work on all times at once, which is faster",
    )


def takes_one_time(function: MatrixFunction, t: Array) -> bool:
    """Whether the function gives a matrix for a time that is a number."""
    try:
        return np.ndim(function(t[0].item())) == 2
    except Exception:  # whatever a function makes of what it was not written for
        return False


def check_array(name: str, value: Any, t: Array, shape: tuple[int, int] | None = None) -> Array:
    """Refuse what is no array (N, rows, columns), of the shape that it had before."""
    if not isinstance(value, np.ndarray):
        raise ArgumentError(
            f"{name}(t) is no array", got=type(value).__name__, expected="numpy.array of what it returns"
        )
    if value.ndim != 3 or len(value) != len(t) or shape not in (None, value.shape[1:]):
        rows = "rows, columns" if shape is None else f"{shape[0]}, {shape[1]}"
        raise ArgumentError(
            f"{name}(t) has the wrong shape",
            got=value.shape,
            expected=f"({len(t)}, {rows}) for t of shape ({len(t)},)",
        )
    if value.dtype.kind == "f" and value.dtype.itemsize not in (4, 8):
        raise ArgumentError(
            f"{name}(t) is of a precision that linear algebra does not take",
            got=f"numbers of type {value.dtype}",
            expected="numbers of type float64",
            todo="return values.astype(float)",
        )
    return value


def check_finite(name: str, values: Array, t: Array) -> Array:
    """Refuse samples (N, rows, columns) that are complex, no numbers, or not finite at one of the times (N,), naming it."""
    if np.issubdtype(values.dtype, np.floating) and not np.isfinite(values).all():
        k, *entry = np.argwhere(~np.isfinite(values))[0].tolist()
        raise ArgumentError(
            f"{name} is not finite at t = {t[k]:.6g} s",
            got=f"{values[(k, *entry)]} at {entry}",
            expected="finite numbers",
        )
    return real_array(f"{name}(t)", values)
