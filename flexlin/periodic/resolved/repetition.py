"""Does a coefficient repeat with the period that was given, and when it is called twice?"""

from collections.abc import Callable

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotPeriodic, UnresolvedCoefficient
from flexlin.periodic.chebyshev import chebyshev_coefficients, chebyshev_nodes
from flexlin.periodic.resolved.sampling import Sampler, stratified

REPEAT = 1e-8
"""Of an entry's size: a period that is given with eight digits passes."""
AHEAD = 4
"""Periods beyond the first over which a list of pieces must stay smooth."""


TWICE = 1e-14
"""Of an entry's size: what the order of sums may change between two calls."""


def need_repeatability(sample: Sampler, t: Array) -> None:
    """Refuse a coefficient that gives other values when it is called again at the same times t (N,) in [0, T)."""
    gap = np.abs(sample(t) - sample(t))
    if np.all(gap <= TWICE * sample.scale):
        return
    at, entry = np.unravel_index(int(np.argmax(gap - TWICE * sample.scale)), gap.shape)
    raise UnresolvedCoefficient(
        "A(t) is not the same when it is called twice",
        got=f"values {gap[at, entry]:.3g} apart at t = {t[at]:.15g} s",
        expected="the same value for the same time",
        todo="take random numbers and what is counted on from call to call out of A: draw them once, before",
    )


def need_repetition(
    sample: Sampler, series: Callable[[Array], Array], t: Array, allowed: Array, rough: Array | None = None
) -> None:
    """Refuse a coefficient that goes on after T as something else than itself.

    The rule: |A(t + T) - A(t)| must stay below 1e-8 of each entry's size (or its noise). Three kinds of function are let off, because
    they are written for one period and say nothing about times beyond it. (1) One that raises or is not finite there. (2) A list
    of pieces without modulo, such as `A1 if t < 1.0002 else A2` on [0, 2): it jumps or has a kink strictly inside (0, T) and
    nowhere in (T, 5 T), where its last piece merely goes on. (3) One whose periodic continuation is smooth at T, and which from T on
    is constant or repeats with T: a pulse written without modulo. A function that is smooth inside the period and goes on otherwise,
    or that jumps inside and again beyond, was given another period.

    Parameters: series: A on [0, T) as resolved; t: times in (0, T) at which to compare; allowed (E,): deviations that do not count;
    rough: places in [0, T) at which A is not smooth, 0 for the wrap.
    Raises: NotPeriodic.
    """
    T, rough = sample.period, np.empty(0) if rough is None else rough
    try:
        beyond = sample.unwrapped(t + T)
    except (ValueError, IndexError, ArithmeticError):
        return
    gap = np.abs(beyond - series(t).reshape(len(t), -1))
    excess = gap / (REPEAT * sample.scale + 4 * allowed)
    if (
        excess.max() <= 1
        or (np.any(rough > 0) and _goes_on(sample))
        or (0.0 not in rough and _settles(sample, t, allowed))
    ):
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


def _settles(sample: Sampler, t: Array, allowed: Array) -> bool:
    """Whether A repeats with T from T on: at the times t and at many others, for four periods."""
    T = sample.period
    times = np.concatenate([t, T * stratified(1024)])
    first = sample.unwrapped(times + T)
    limit = REPEAT * sample.scale + 4 * allowed
    return all(np.all(np.abs(sample.unwrapped(times + k * T) - first) <= limit) for k in range(2, AHEAD + 1))
