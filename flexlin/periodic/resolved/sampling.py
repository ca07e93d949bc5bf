"""A coefficient as the resolution sees it: checked, counted, in bounded batches; and the times at which it is checked."""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.periodic.resolved.sizes import largest_sizes

CHUNK = 2**23
"""Bytes of samples that one call of the coefficient may return."""
KEPT = 2**26
"""Bytes of samples at check points that are kept."""
BATCH = 2**19
"""Bytes of samples that are compared at a time: they stay in the processor's cache."""
CHECKS, ENDS = 12289, np.geomspace(3e-11, 3e-5, 19)
"""Check points of a function of which nothing is known; and where, from either end of the period, it is checked too: a pulse there begins
or ends with it."""
REPEATS = 5
"""Times at which a smooth function is compared with itself a period later."""
GOLDEN = (np.sqrt(5) - 1) / 2


class Sampler:
    """A(t) on [0, T) as rows (N, E), E = rows * columns, how often it was called, each entry's largest size so far, at least `least`."""

    def __init__(self, function: Callable[[Array], Array], period: float, least: float | Array = 0.0):
        self.function, self.period, self.least = function, period, least
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
        return self.unwrapped(t, inside=True)

    def unwrapped(self, t: Array, inside: bool = False) -> Array:
        """Sample at the times as they are; `inside`: all lie in [0, T)."""
        parts = []
        for i in range(0, max(len(t), 1), self.chunk):
            rows, sizes = self._checked(t[i : i + self.chunk])
            parts.append(rows)
            if inside:
                np.maximum(self.scale, sizes, out=self.scale)
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def least_sizes(self) -> Array:
        """A copy of the sizes (E,) below which no entry counts."""
        rows, columns = self.shape or (0, 0)
        return np.ravel(self.least) + np.zeros(rows * columns)

    @property
    def chunk(self) -> int:
        """How many times go into one call."""
        return 128 if self.shape is None else max(64, CHUNK // (8 * self.shape[0] * self.shape[1]))

    def _checked(self, t: Array) -> tuple[Array, Array]:
        """A at the times (N, E), and the largest size of each entry (E,)."""
        values = np.asarray(self.function(t))
        wanted = "(N, rows, columns)" if self.shape is None else f"(N, {self.shape[0]}, {self.shape[1]})"
        if values.ndim != 3 or len(values) != len(t) or 0 in values.shape or self.shape not in (None, values.shape[1:]):
            raise ArgumentError(
                "A(t) has the wrong shape", got=f"{values.shape} for {len(t)} times", expected=f"{wanted}, real numbers"
            )
        if values.dtype.kind not in "fiu":
            raise ArgumentError("A(t) is not real", got=f"numbers of type {values.dtype}", expected="real numbers")
        if self.shape is None:
            self.shape = (values.shape[1], values.shape[2])
            self.scale = self.least_sizes()
        if values.dtype.kind in "iu":
            self._need_constant(values)
        rows = values.reshape(len(t), values.shape[1] * values.shape[2]).astype(float, copy=False)
        sizes = largest_sizes(rows) if len(rows) else np.zeros(rows.shape[1])
        if not np.isfinite(sizes).all():
            first, entry = np.argwhere(~np.isfinite(rows))[0]
            place = tuple(int(i) for i in np.unravel_index(entry, self.shape))
            raise ArgumentError(
                f"A(t) is not finite at t = {t[first]:.17g} s",
                got=f"{rows[first, entry]} in entry {place}",
                expected="finite numbers over the whole period",
            )
        self.count += len(t)
        return rows, sizes

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


class CheckPoints:
    """Increasing times in [0, T) at which a representation is compared with A; the samples are kept where memory allows.

    usual: whether they are those of `usual_phases`.
    """

    def __init__(self, sample: Sampler, t: Array, usual: bool = False):
        self.sample, self._given, self.usual = sample, t, usual
        self._kept: Array | None = None
        self._asked = False

    @lazy
    def t(self) -> Array:
        """The times."""
        if self.usual:
            return self._given
        t = np.mod(self._given, self.sample.period)
        return t if np.all(np.diff(t) > 0) else np.unique(t)

    def batches(self) -> Iterator[tuple[slice, Array]]:
        """Parts of the times and A there (N, E), as small as the processor's cache; kept from the second time on."""
        entries, t = len(self.sample.scale), self.t
        if self._kept is None and self._asked and self._may_be_kept():
            self._kept = self.sample(t)
        self._asked = True
        for part in (slice(i, i + size) for size in (BATCH // (8 * entries) + 1,) for i in range(0, len(t), size)):
            yield part, self.sample(t[part]) if self._kept is None else self._kept[part]

    def values(self, t: Array) -> Array:
        """A at times t, among them check points: (N, E)."""
        if not self._may_be_kept():
            return self.sample(t)
        if self._kept is None:
            self._kept = self.sample(self.t)
        place = np.clip(np.searchsorted(self.t, t), 0, len(self.t) - 1)
        known = self.t[place] == t
        values = self._kept[place]
        if not known.all():
            values[~known] = self.sample(t[~known])
        return values

    def _may_be_kept(self) -> bool:
        return 8 * len(self.t) * len(self.sample.scale) <= KEPT


@lru_cache(maxsize=16)
def stratified(count: int, jitter: float = 0.2) -> Array:
    """Return one phase in each of `count` equal cells of (0, 1), off the middle by the golden sequence; gaps below (1 + jitter) / count."""
    i = np.arange(count)
    phases = (i + 0.5 + jitter * (np.mod((i + 1) * GOLDEN, 1.0) - 0.5)) / count
    phases.setflags(write=False)
    return phases


@lru_cache(maxsize=1)
def usual_phases() -> Array:
    """Return increasing phases in (0, 1) at which a function of which nothing is known is checked, closer to the ends of the period."""
    return np.concatenate([ENDS, stratified(CHECKS), 1 - ENDS[::-1]])


def graded(centres: Sequence[float] | Array, nearest: float, farthest: float, ratio: float) -> Array:
    """Return times on both sides of each centre, at distances that grow by `ratio` from `nearest` to `farthest`."""
    steps = int(np.ceil(np.log(farthest / nearest) / np.log(ratio))) + 1
    distances = nearest * ratio ** np.arange(max(steps, 1))
    return np.add.outer(np.asarray(centres, dtype=float), np.concatenate([-distances, distances])).ravel()
