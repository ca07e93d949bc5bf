"""One counted door to the user's function: checked, in chunks that stay in the processor's cache; and the times at which it is asked."""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from math import factorial

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError, NotPeriodic, UnresolvedCoefficient
from flexlin.periodic.coefficients import check_array, check_finite
from flexlin.periodic.interpolation import CACHED_BYTES, chebyshev_coefficients, chebyshev_nodes, golden
from flexlin.precision import CUBE_ROOT_EPS, EPS, FAINT, ROOT_EPS, SLIGHT, TINY

LEAST_SIZE = TINY / EPS
RESOLVED_TOL = 1e-13
"""Of an entry's size: agreement of its series with A that is asked for."""
SEARCH_BLOCKS, TIMES_IN_BLOCK = 128, 80
"""The times of a search: blocks of a period, and times in each, at the same places in all: gaps stay below T / 10000."""
JUMP_WIDTH = 1e-11
"""Of the period: what happens closer to a jump counts as part of it, and edges closer to another are left out."""
NOISE_DEVIATIONS = 6.0
"""Standard deviations of measured noise that count as agreement."""
POINTS, DIFFERENCE_ORDER = 16, 5
"""Times of a place at which noise is measured, and the least order of their differences."""
PERIODS_AHEAD = 4
"""Periods beyond the first over which a list of pieces must stay smooth."""

Least = float | Array | Callable[[Array], Array]
"""The size of the entries below which none counts: one number, (rows, columns), or a function of first samples (N, rows, columns)."""


class Sampler:
    """A(t) on [0, T) as rows (N, E), E = rows * columns, how often it was called, and each entry's largest size so far.

    Parameters: tol: agreement that is asked for, of each entry's size; least: sizes whose rounding is no worse than tol of an entry.
    """

    def __init__(
        self, function: Callable[[Array], Array], period: float, tol: float = RESOLVED_TOL, least: Least = 0.0
    ):
        self.function, self.period, self.tol, self.least = function, period, tol, least
        self.count = 0
        self.shape: tuple[int, int] | None = None
        self.scale: Array = np.zeros(0)
        self._whole: Array | None = None

    def __call__(self, t: Array) -> Array:
        """Sample at times in (-T, 2 T), wrapped into [0, T)."""
        T = self.period
        if len(t) and (t.min() < 0 or t.max() >= T):
            t = np.where(t < 0, t + T, t)
            t = np.where(t >= T, t - T, t)
        rows = self.unwrapped(t)
        np.maximum(self.scale, np.abs(rows).max(axis=0, initial=0.0), out=self.scale)
        return rows

    def unwrapped(self, t: Array) -> Array:
        """Sample at the times as they are; sizes beyond the period do not count."""
        if not len(t):
            return np.empty((0, len(self.scale)))
        return np.concatenate([check_finite("A", self._ask(part), part) for part in self._parts(t)]).reshape(len(t), -1)

    def contract(self, t: Array, weights: Array) -> Array:
        """The sum of A's entries, each times its weight (E,), at times in [0, T): (N,); no numbers or infinite where A is."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.concatenate([self._ask(part).reshape(len(part), -1) @ weights for part in self._parts(t)])

    def _parts(self, t: Array) -> Iterator[Array]:
        """The times, as many at once as go into one call."""
        while len(t):
            some = self.chunk
            yield t[:some]
            t = t[some:]

    @property
    def chunk(self) -> int:
        """How many times go into one call: at first a few hundred; of large matrices fewer than that, but enough to be worth a call."""
        if self.shape is None:
            return 2 * SEARCH_BLOCKS
        few = CACHED_BYTES // (8 * self.shape[0] * self.shape[1])
        return max(few, min(10 * few, 2 * TIMES_IN_BLOCK), POINTS)

    def _ask(self, t: Array) -> Array:
        """A at the times, (N, rows, columns)."""
        values = check_array("A", np.asarray(self.function(t)), t, self.shape)
        if values.dtype.kind not in "fiu":
            raise ArgumentError("A(t) is not real", got=f"numbers of type {values.dtype}", expected="real numbers")
        self.count += len(t)
        if self.shape is None:
            self.shape = (values.shape[1], values.shape[2])
            least = self.least(values[t < self.period]) if callable(self.least) else self.least
            self.scale = EPS / self.tol * np.ravel(least) + np.zeros(values[0].size)
        if values.dtype.kind in "iu":
            self._need_constant(values)
        return values

    def _need_constant(self, values: Array) -> None:
        """Whole numbers that change with time are most often real ones that were cut off on assignment."""
        self._whole = values[0] if self._whole is None else self._whole
        if np.any(values != self._whole):
            raise ArgumentError(
                "A(t) changes with time but holds whole numbers",
                got=f"an array of type {values.dtype}",
                expected="floating-point numbers",
                todo="fill an array of floats: one of integers cuts off what is assigned to it",
            )


@lru_cache(maxsize=16)
def stratified(count: int, jitter: float = 0.2) -> Array:
    """Return one phase in each of `count` equal cells of (0, 1), off the middle by the golden sequence; gaps below (1 + jitter) / count."""
    i = np.arange(count)
    phases = (i + 0.5 + jitter * (golden(i + 1) - 0.5)) / count
    phases.setflags(write=False)
    return phases


@lru_cache(maxsize=1)
def search_phases() -> Array:
    """Increasing phases (SEARCH_BLOCKS * TIMES_IN_BLOCK,) at which an unknown function is looked at, on no regular grid."""
    phases = np.add.outer(np.arange(SEARCH_BLOCKS), stratified(TIMES_IN_BLOCK, 0.03)).ravel() / SEARCH_BLOCKS
    phases.setflags(write=False)
    return phases


@lru_cache(maxsize=1)
def end_phases() -> Array:
    """Phases ever closer to the ends of the period: a pulse there begins or ends with it."""
    return np.mod(graded([0.0], JUMP_WIDTH, 1 / (SEARCH_BLOCKS * TIMES_IN_BLOCK), np.pi), 1.0)


def graded(centres: Sequence[float] | Array, nearest: float, farthest: float, ratio: float) -> Array:
    """Return times on both sides of each centre, at distances that grow by `ratio` from `nearest` to `farthest`."""
    steps = int(np.ceil(np.log(farthest / nearest) / np.log(ratio))) + 1
    distances = nearest * ratio ** np.arange(max(steps, 1))
    return np.add.outer(np.asarray(centres, dtype=float), np.concatenate([-distances, distances])).ravel()


def noise_level(sample: Sampler, begin: Array, end: Array) -> Array:
    """Estimate the standard deviation of the noise of A on panels (P,), for each entry: (P, E).

        sigma_k^2 = (k!)^2 / (2 k)!  mean (Delta^k f)^2

    The larger of two orders k, on the quieter of two places of the panel, so that a jump at one of them is not taken for noise. What
    is rounding of the largest entry at all of them comes and goes: there the louder place counts. What is louder than SLIGHT is a motion
    that was not followed.
    Source: Moré and Wild, Estimating computational noise, SIAM J. Sci. Comput. 33 (2011), Eq. (2.4).
    """
    where = 0.1 + 0.8 * golden(1 + np.arange(2) + 0.37 * np.arange(len(begin))[:, None])
    width = (end - begin)[:, None]
    t = (begin[:, None] + where * width)[:, :, None] + CUBE_ROOT_EPS * width[:, :, None] * np.arange(POINTS)
    size = np.where(sample.scale > 0, sample.scale, 1.0)
    values = sample(t.ravel()).reshape(*t.shape, -1) / size
    levels = []
    for k in (DIFFERENCE_ORDER, DIFFERENCE_ORDER + 1):
        gamma = factorial(k) ** 2 / factorial(2 * k)
        levels.append(np.sqrt(gamma * (np.diff(values, k, axis=2) ** 2).mean(axis=2)))
    faint = 2 ** (DIFFERENCE_ORDER + 4) * EPS * sample.scale.max()
    quiet, loud = (extreme(np.maximum(*levels), axis=1) * size for extreme in (np.min, np.max))
    level = np.where(loud <= np.maximum(FAINT * sample.scale, faint), loud, quiet)
    return np.asarray(np.where(level <= np.maximum(SLIGHT * sample.scale, faint), level, 0.0))


def need_repeatability(sample: Sampler, t: Array) -> None:
    """Refuse a coefficient that gives other values when it is called again at the same times t (N,) in [0, T)."""
    excess = np.abs(sample(t) - sample(t)) - sample.tol * sample.scale
    at, entry = np.unravel_index(int(np.argmax(excess)), excess.shape)
    if excess[at, entry] <= 0:
        return
    raise UnresolvedCoefficient(
        "A(t) is not the same when it is called twice",
        got=f"values {excess[at, entry]:.3g} apart at t = {t[at]:.15g} s",
        expected="the same value for the same time",
        todo="take random numbers and what is counted on from call to call out of A: draw them once, before",
    )


def need_repetition(
    sample: Sampler, here: Array, beyond: Array | None, t: Array, allowed: Array, rough: Sequence[float] | Array = ()
) -> None:
    """Refuse a coefficient that goes on after T as something else than itself.

    The rule: |A(t + T) - A(t)| must stay below 1.5e-8 of each entry's size (or its noise). Three kinds of function are let off, because
    they are written for one period and say nothing about times beyond it. (1) One that raises or is not finite there. (2) A list
    of pieces without modulo, such as `A1 if t < 1.0002 else A2` on [0, 2): it jumps or has a kink strictly inside (0, T) and
    nowhere in (T, 5 T), where its last piece merely goes on. (3) One whose periodic continuation is smooth at T, and which from T on
    is constant or repeats with T: a pulse written without modulo. A function that is smooth inside the period and goes on otherwise,
    or that jumps inside and again beyond, was given another period.

    Parameters: here, beyond: A at times t (N,) in (0, T), as resolved, and a period later as it is: (N, E), nothing for the first kind;
    allowed (E,): deviations that do not count; rough: places in [0, T) at which A is not smooth, 0 for the wrap.
    Raises: NotPeriodic.
    """
    if beyond is None:
        return
    gap, T = np.abs(beyond - here), sample.period
    limit = ROOT_EPS * sample.scale + 4 * allowed
    if (gap <= limit).all():
        return
    if (np.any(np.asarray(rough) > 0) and _goes_on(sample)) or (0.0 not in rough and _settles(sample, t, limit)):
        return
    at, entry = np.unravel_index(int((gap / limit).argmax()), gap.shape)
    rows, columns = np.unravel_index(int(entry), sample.shape or (1, 1))
    relative = gap[at, entry] / max(sample.scale[entry], TINY)
    raise NotPeriodic(
        f"A(t) does not repeat with the period T = {T:.15g} s",
        got=f"|A(t + T) - A(t)| = {gap[at, entry]:.3g} at t = {t[at]:.6g} s in entry ({rows}, {columns}), {relative:.3g} of its size",
        expected=f"at most {ROOT_EPS:.2g} of its size",
        todo="give the period of A; if A is written for 0 <= t < T only, take t modulo T in it",
    )


def look_beyond(sample: Sampler, t: Array) -> Array | None:
    """A at times t, which may lie beyond the period (N, E); nothing where it raises or is not finite."""
    try:
        return sample.unwrapped(t)
    except (ValueError, IndexError, ArithmeticError):
        return None


def _goes_on(sample: Sampler) -> bool:
    """Whether A is one smooth piece on (T, 5 T)."""
    for count in 1 + 2 ** np.array([6, 8, 10]):
        values = look_beyond(sample, sample.period * (1 + PERIODS_AHEAD * (1 + chebyshev_nodes(count)) / 2))
        if values is None:
            return True
        tail = np.abs(chebyshev_coefficients(values[None])[0, -max(4, count // 16) :]).max(axis=0)
        if np.all(tail <= ROOT_EPS * np.maximum(sample.scale, np.abs(values).max(axis=0))):
            return True
    return False


def _settles(sample: Sampler, t: Array, limit: Array) -> bool:
    """Whether A repeats with T from T on, up to a limit (E,): at the times t and at many others, for four periods."""
    T = sample.period
    times = np.concatenate([t, T * stratified(1024)])
    first = sample.unwrapped(times + T)
    return all(np.all(np.abs(sample.unwrapped(times + k * T) - first) <= limit) for k in range(2, PERIODS_AHEAD + 1))
