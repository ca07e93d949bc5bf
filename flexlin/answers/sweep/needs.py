"""On how many segments each value of a sweep is computed: what a few of them needed, as a function of their parameters."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.many.kernel import WIDTH, Kernel, measure_spread

STARTS = (
    4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 22, 24, 26, 28, 32, 36, 40, 44, 48, 52, 56, 64, 72, 80, 88, 96, 104, 112, 128,
    144, 160, 176, 192, 208, 224, 256, 288, 320, 352, 384, 416, 448, 512, 576, 640, 704, 768, 832, 896, 1024,
)  # fmt: skip
"""Numbers of segments among which is chosen; the resolutions are multiples of them."""
FEW = 3
"""Resolutions of a first trial."""
ORDER = 8
"""Of the extrapolated logs, by the length of the segments."""
STEPS = 1.15, 2.0
"""Factors between the numbers of segments of a pilot's trials."""
FURTHER = 4.0
"""Pilots that need so many times more than the others are given up."""
PILOTS, FEWEST, EACH = 192, 24, 8
"""Values that are tried: one of so many, within limits. A trial of one costs as much as some of the values."""
WIDE = 2.0
"""Parameters that are positive and differ by more than this factor count by their logs."""
DECIMALS = 6
"""Of the coefficients: what rounding does differently in another run must not decide on how many segments a value is computed."""
MISSED = 1.5
"""Work of further trials of a value that missed tol in its first one, over that of a trial which just meets it."""


@dataclass(frozen=True)
class Needs:
    """log(segments) = coefficients . polynomial(parameters), of degree 2 or less.

    `low`, `high` (P,): of the parameters, or of their logs where `by_log`; `most`: of log(segments); spread: of the logs of the moduli.
    """

    low: Array
    high: Array
    by_log: Array
    coefficients: Array
    most: float
    spread: float

    def predict(self, points: Array) -> Array:
        """Segments for points (V, P)."""
        placed = place_points(points, self.low, self.high, self.by_log)
        logs = expand_polynomial(placed, len(self.coefficients)) @ self.coefficients
        return np.asarray(np.exp(np.clip(logs, 0.0, self.most)))

    @property
    def usual(self) -> int:
        """The number of segments in the middle of the parameters."""
        middle = (self.low + self.high) / 2
        wanted = self.predict(np.where(self.by_log, np.exp(middle), middle)[None])
        return next(pack(wanted))[0]


def pack(wanted: Array) -> Iterator[tuple[int, Array]]:
    """Segments and which values (V,) to compute on them: eight that want about as many are one vector, and have what the last one wants.

    Values that want as many stay in order: neighbours have much in common, and a vector takes as long as its slowest value.
    """
    rungs = np.searchsorted(STARTS, wanted * (1 - 1e-9)).clip(max=len(STARTS) - 1)
    order = np.argsort(rungs, kind="stable")
    last = np.minimum(np.arange(WIDTH - 1, len(order) + WIDTH - 1, WIDTH), len(order) - 1)
    rungs = rungs[order[last]]
    for rung in np.unique(rungs):
        vectors = np.flatnonzero(rungs == rung)
        yield STARTS[rung], order[WIDTH * vectors[0] : WIDTH * (vectors[-1] + 1)]


def learn_needs(kernel: Kernel, points: Array, scale: Array, tol: float) -> Needs:
    """What values spread over the points (V, P) need, and the polynomial through it that makes the least work."""
    count = np.arange(np.clip(len(points) // EACH, FEWEST, PILOTS))
    pilots = points[np.unique((count * 0.6180339887498949 % 1.0 * len(points)).astype(int))]
    needs, spread = try_pilots(kernel, pilots, scale, tol)
    usable = np.isfinite(pilots).all(axis=1)
    inside = pilots[usable] if usable.any() else np.ones((1, points.shape[1]))
    by_log = (inside.min(axis=0) > 0) & (inside.max(axis=0) > WIDE * inside.min(axis=0))
    logs = np.where(by_log, np.log(np.where(by_log, inside, 1.0)), inside)
    low, high = logs.min(axis=0), logs.max(axis=0)
    met = usable & np.isfinite(needs)
    if not met.any():
        return Needs(low, high, by_log, np.log([STARTS[-1]]), np.log(STARTS[-1]), spread)
    placed, wanted = place_points(pilots[met], low, high, by_log), np.log(needs[met])
    P = placed.shape[1]
    terms = next(k for k in ((P + 1) * (P + 2) // 2, P + 1, 1) if k == 1 or 4 * k <= len(placed))
    polynomial = expand_polynomial(placed, terms)
    coefficients = np.linalg.lstsq(polynomial, wanted, rcond=1e-9)[0]
    coefficients[0] += choose_margin(wanted - polynomial @ coefficients)
    return Needs(low, high, by_log, coefficients.round(DECIMALS), float(wanted.max()), spread)


def try_pilots(kernel: Kernel, pilots: Array, scale: Array, tol: float) -> tuple[Array, float]:
    """Segments (V,) on which each pilot just meets tol, infinite where none does, and the spread of the logs of their moduli."""
    needs, spread = np.full(len(pilots), np.inf), -np.inf
    wanted = np.full(len(pilots), float(STARTS[0]))
    left = np.arange(len(pilots))
    while len(left):
        left = left[np.argsort(wanted[left], kind="stable")]
        segments = int(wanted[left[0]])
        now = left[wanted[left] <= STEPS[0] * segments]
        segments = int(wanted[now].max())
        found = kernel.find_logs(pilots[now], segments, scale, tol / 100, np.inf, np.inf, FEW)
        misses = found.misses(tol)
        growth = misses ** (1 / ORDER)
        met = misses <= 1
        needs[now[met]] = np.maximum(segments * growth[met], segments / STEPS[1])
        if met.any():
            spread = max(spread, measure_spread(found.logs[met]))
        wanted[now] = np.ceil(segments * np.clip(growth, *STEPS))
        known = needs[np.isfinite(needs)]
        most = min(STARTS[-1], FURTHER * known.max(initial=0.0) if known.size else np.inf)
        left = left[np.isinf(needs[left]) & (wanted[left] <= most)]
    return needs, spread if np.isfinite(spread) else np.inf


def choose_margin(residuals: Array) -> float:
    """What to add to a prediction whose residuals are known, so that first trials and what they miss cost least together."""
    margins = np.append(residuals, 0.0)
    work = np.exp(margins) + MISSED * ((residuals > margins[:, None]) * np.exp(residuals)).mean(axis=1)
    return float(margins[work.argmin()])


def place_points(points: Array, low: Array, high: Array, by_log: Array) -> Array:
    """Parameters (V, P) from -1 to 1 over the pilots."""
    with np.errstate(invalid="ignore", divide="ignore"):
        values = np.where(by_log, np.log(np.where(by_log, points, 1.0)), points)
    wide = high > low
    placed = np.where(wide, (2 * values - low - high) / np.where(wide, high - low, 1.0), 0.0)
    return np.asarray(np.clip(np.nan_to_num(placed), -1.0, 1.0))


def expand_polynomial(placed: Array, terms: int) -> Array:
    """1, x_i, x_i x_j for parameters (V, P): the first `terms` of them, (V, terms)."""
    V, P = placed.shape
    one = np.ones((V, 1))
    if terms == 1:
        return one
    first, second = np.triu_indices(P) if terms > P + 1 else (np.zeros(0, dtype=int),) * 2
    return np.concatenate([one, placed, placed[:, first] * placed[:, second]], axis=1)
