"""A log cut into windows: what drives each node of a fixed grid, and which nodes each sample lies between."""

from dataclasses import dataclass, field, replace

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import ArgumentError
from flexlin.identification.log import FEWEST, Log


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows of K steps of h seconds each, side by side; a shorter one runs on behind its end, and nothing is compared there.

    starts (W,): times in s; rows (W, N): numbers of the log's rows, -1 where a window has fewer.
    """

    log: Log
    starts: Array
    ends: Array
    h: float
    steps: int
    rows: Array
    driven: dict[bytes, tuple[Array, Array]] = field(default_factory=dict, init=False)

    @classmethod
    def of(cls, log: Log, length: float, substeps: int = 1) -> "Windows":
        """Cut the stretches of a log into windows of a length in s, one after the other; a rest of a quarter is one too.

        Raises: ArgumentError where no stretch is long enough.
        """
        step, chosen = log.step, []
        if length < FEWEST * step:
            expected = f"{FEWEST} samples, {FEWEST * step:.3g} s, or more"
            raise ArgumentError("the windows of the log are too short", got=f"{length:.3g} s", expected=expected)
        for stretch in log.stretches:
            time = log.time[stretch]
            edges = np.arange(time[0], time[-1] - 0.25 * length, length)
            edges = edges if len(edges) else time[:1]
            first, behind = (np.searchsorted(time, at - 1e-6 * step) for at in (edges, edges + length))
            ends = zip(first, behind, strict=True)
            chosen += [stretch.start + np.arange(a, b) for a, b in ends if b - a >= FEWEST]
        if not chosen:
            got = f"{len(log.stretches)} stretches without a gap"
            raise ArgumentError("the log has no stretch that is long enough", got=got, expected=f"{FEWEST} samples")
        rows = np.full((len(chosen), max(map(len, chosen))), -1)
        for k, one in enumerate(chosen):
            rows[k, : len(one)] = one
        first, last = rows[:, 0], np.array([one[-1] for one in chosen])
        starts, ends = log.time[first], log.time[last]
        h = step / substeps
        steps = max(4, int(np.ceil((ends - starts).max() / h - 1e-6)))
        check_size("the log's prediction", 8 * len(chosen) * steps * 400, "give a part of the log, or thin it")
        return cls(log, starts, ends, h, steps, rows)

    def refined(self, substeps: int) -> "Windows":
        """The same windows on a grid of so many steps for one of the log's."""
        h = self.log.step / substeps
        return replace(self, h=h, steps=max(4, int(np.ceil((self.ends - self.starts).max() / h - 1e-6))))

    def chosen(self, which: Array) -> "Windows":
        """Some of the windows."""
        return replace(self, starts=self.starts[which], ends=self.ends[which], rows=self.rows[which])

    def head(self, seconds: float) -> "Windows":
        """The first seconds of each window."""
        inside = self.there & (self.log.time[self.rows] <= self.starts[:, None] + seconds)
        rows = np.where(inside, self.rows, -1)[:, : int(inside.sum(axis=1).max())]
        ends = np.minimum(self.ends, self.starts + seconds)
        steps = max(4, int(np.ceil((ends - self.starts).max() / self.h - 1e-6)))
        return replace(self, ends=ends, rows=rows, steps=steps)

    @property
    def count(self) -> int:
        return len(self.starts)

    @property
    def there(self) -> Array:
        """Which rows are samples, (W, N)."""
        return np.asarray(self.rows >= 0)

    def drive(self, delays: Array) -> tuple[Array, Array]:
        """The input columns and their slopes at nodes and in their middles, each (2 K + 1, W, inputs), so much delayed.

        Between samples by a cubic spline through each stretch; before and behind it the input is what it was at its end.
        """
        from scipy.interpolate import CubicSpline

        if delays.tobytes() in self.driven:
            return self.driven[delays.tobytes()]
        times = self.starts + 0.5 * self.h * np.arange(2 * self.steps + 1)[:, None]
        u = np.empty((*times.shape, len(self.log.inputs)))
        slope = np.empty_like(u)
        for stretch in self.log.stretches:
            time = self.log.time[stretch]
            mine = (self.starts >= time[0]) & (self.starts <= time[-1])
            for k, values in enumerate(self.log.inputs.values()):
                spline, at = CubicSpline(time, values[stretch]), times[:, mine] - delays[k]
                held = np.clip(at, time[0], time[-1])
                u[:, mine, k] = spline(held)
                slope[:, mine, k] = np.where(held == at, spline(held, 1), 0.0)
        self.driven.clear()
        self.driven[delays.tobytes()] = u, slope
        return u, slope

    def readings(self) -> Array:
        """The outputs' readings, (W, N, outputs); not a number where there is none."""
        table = np.stack(list(self.log.outputs.values()), axis=-1)
        return np.where(self.there[:, :, None], table[self.rows], np.nan)

    def lookup(self, delay: float) -> tuple[Array, Array, Array, Array]:
        """How a value at each sample's time, less a delay, follows from four nodes: Lagrange's cubic.

        Returns: the first node (W, N), weights and their slopes by time (W, N, 4), and which samples lie on the grid (W, N).
        """
        time = self.log.time[self.rows] - delay - self.starts[:, None]
        place = np.where(self.there, time / self.h, 0.0)
        first = np.clip(np.floor(place).astype(int) - 1, 0, self.steps - 3)
        x = np.maximum(place, 0.0) - first
        weights, slopes = lagrange(x)
        return first, weights, slopes / self.h, (place > -1e-6) & self.there


def lagrange(x: Array) -> tuple[Array, Array]:
    """Weights of values at 0, 1, 2, 3 for that at x, and their derivatives, (..., 4)."""
    weights, slopes = np.empty((*x.shape, 4)), np.empty((*x.shape, 4))
    for i in range(4):
        others = [x - j for j in range(4) if j != i]
        scale = np.prod([i - j for j in range(4) if j != i])
        weights[..., i] = others[0] * others[1] * others[2] / scale
        slopes[..., i] = (others[0] * others[1] + others[1] * others[2] + others[0] * others[2]) / scale
    return weights, slopes
