"""Does a coefficient repeat with the period that was given?"""

from collections.abc import Callable

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotPeriodic
from flexlin.periodic.chebyshev import chebyshev_coefficients, chebyshev_nodes
from flexlin.periodic.sampling import Sampler

REPEAT = 1e-8
"""Of an entry's size: a period that is given with eight digits passes."""
AHEAD = 4
"""Periods beyond the first over which a list of pieces must stay smooth."""


def need_repetition(sample: Sampler, series: Callable[[Array], Array], t: Array, inside: bool, allowed: Array) -> None:
    """Refuse a coefficient that goes on after T as something else than itself.

    The rule: |A(t + T) - A(t)| must stay below 1e-8 of each entry's size (or its noise). Two kinds of function are let off, because
    they are written for one period and say nothing about times beyond it. (1) One that raises or is not finite there. (2) A list
    of pieces without modulo, such as `A1 if t < 1.0002 else A2` on [0, 2): it jumps or has a kink strictly inside (0, T) and
    nowhere in (T, 5 T), where its last piece merely goes on. A function that is smooth inside the period and goes on otherwise, or
    that jumps inside and again beyond, was given another period.

    Parameters: series: A on [0, T) as resolved; t: times in (0, T) at which to compare; inside: whether A is singular strictly inside;
    allowed (E,): deviations that do not count.
    Raises: NotPeriodic.
    """
    T = sample.period
    try:
        beyond = sample.unwrapped(t + T)
    except (ValueError, IndexError, ArithmeticError):
        return
    gap = np.abs(beyond - series(t).reshape(len(t), -1))
    excess = gap / (REPEAT * sample.scale + 4 * allowed)
    if excess.max() <= 1 or (inside and _goes_on(sample)):
        return
    at, entry = np.unravel_index(int(excess.argmax()), gap.shape)
    rows, columns = np.unravel_index(int(entry), sample.shape or (1, 1))
    relative = gap[at, entry] / max(sample.scale[entry], np.finfo(float).tiny)
    raise NotPeriodic(
        f"A(t) does not repeat with the period T = {T:.15g} s",
        got=f"|A(t + T) - A(t)| = {gap[at, entry]:.3g} at t = {t[at]:.6g} s in entry ({rows}, {columns}), {relative:.3g} of its size",
        expected=f"at most {REPEAT:g} of its size",
        todo="give the period of A; if A is written for 0 <= t < T only, take t modulo T in it",
    )


def _goes_on(sample: Sampler) -> bool:
    """Whether A is one smooth piece on (T, 5 T)."""
    T = sample.period
    for count in (65, 257, 1025):
        try:
            values = sample.unwrapped(T * (1 + AHEAD * (1 + chebyshev_nodes(count)) / 2))
        except (ValueError, IndexError, ArithmeticError):
            return True
        tail = np.abs(chebyshev_coefficients(values[None])[0, -max(4, count // 16) :]).max(axis=0)
        if np.all(tail <= REPEAT * np.maximum(sample.scale, np.abs(values).max(axis=0))):
            return True
    return False
