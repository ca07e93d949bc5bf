"""On how many segments each value of a sweep is computed: as many as the nearest of a few values that are tried beforehand."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.many.kernel import WIDTH, Kernel, measure_spread

FEWEST, MOST, FINENESS = 4, 1024, 12
"""Numbers of segments among which is chosen: the least, the largest, and how many in a factor of two."""
STARTS = np.unique(np.round(FEWEST * 2 ** (np.arange(FINENESS * np.log2(MOST / FEWEST) + 1) / FINENESS)).astype(int))
"""The numbers themselves; the resolutions are multiples of them."""
FEW = 3
"""Resolutions of a first trial."""
ORDER = 8
"""Of the extrapolated logs, by the length of the segments."""
STEPS = 1.15, 2.0
"""Factors between the numbers of segments of a value's trials."""
FURTHER = STEPS[1] ** 2
"""Pilots that need so many times more than the others are given up."""
MARGIN = 1.06
"""What values are given over what pilots needed: a second trial costs more."""
PILOTS, EACH = (16, 64), 48
"""Values that are tried: one of so many, within limits. A trial of one costs as much as three of the values."""


@dataclass(frozen=True)
class Needs:
    """What pilots (K, P) needed, as places in STARTS (K,); `spread`: of the logs of their moduli."""

    pilots: Array
    rungs: Array
    spread: float

    def predict(self, points: Array) -> Array:
        """Places in STARTS for points (V, P): the largest of the P + 1 nearest pilots', by how many pilots lie between."""
        near = min(points.shape[1] + 1, len(self.rungs))
        distances = np.zeros((len(points), len(self.rungs)))
        for x, known in zip(points.T, self.pilots.T, strict=True):
            steps = np.unique(known)
            places = [np.interp(each, steps, np.arange(len(steps))) for each in (np.nan_to_num(x), known)]
            distances += (places[0][:, None] - places[1]) ** 2
        return np.asarray(self.rungs[np.argpartition(distances, near - 1, axis=1)[:, :near]].max(axis=1))

    @property
    def usual(self) -> int:
        """The number of segments that a pilot needs in the middle."""
        return int(STARTS[np.sort(self.rungs)[len(self.rungs) // 2]])


def find_rungs(wanted: Array) -> Array:
    """The least places in STARTS with as many segments as wanted."""
    return np.searchsorted(STARTS, wanted * (1 - 1e-9)).clip(max=len(STARTS) - 1)


def pack(rungs: Array) -> Iterator[tuple[int, Array]]:
    """Segments and which values (V,) to compute on them: eight that want about as many are one vector, and have what the last one wants.

    Values that want as many stay in order: neighbours have much in common, and a vector takes as long as its slowest value.
    """
    order = np.argsort(rungs, kind="stable")
    last = np.minimum(np.arange(WIDTH - 1, len(order) + WIDTH - 1, WIDTH), len(order) - 1)
    of_vectors = rungs[order[last]]
    for rung in np.unique(of_vectors):
        vectors = np.flatnonzero(of_vectors == rung)
        yield int(STARTS[rung]), order[WIDTH * vectors[0] : WIDTH * (vectors[-1] + 1)]


def learn_needs(kernel: Kernel, points: Array, scale: Array, tol: float) -> Needs:
    """What values spread over the points (V, P) need."""
    count = np.arange(np.clip(len(points) // EACH, *PILOTS))
    pilots = points[np.unique((count * 0.6180339887498949 % 1.0 * len(points)).astype(int))]
    needs, spread = try_pilots(kernel, pilots, scale, tol)
    met = np.isfinite(pilots).all(axis=1) & np.isfinite(needs)
    if not met.any():
        return Needs(np.zeros((1, points.shape[1])), np.array([len(STARTS) - 1]), spread)
    return Needs(pilots[met], find_rungs(MARGIN * needs[met]), spread)


def try_pilots(kernel: Kernel, pilots: Array, scale: Array, tol: float) -> tuple[Array, float]:
    """Segments (V,) on which each pilot just meets tol, infinite where none does, and the spread of the logs of their moduli."""
    needs, spread = np.full(len(pilots), np.inf), -np.inf
    wanted = np.full(len(pilots), float(FEWEST))
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
        most = min(MOST, FURTHER * known.max(initial=0.0) if known.size else np.inf)
        left = left[np.isinf(needs[left]) & (wanted[left] <= most)]
    return needs, spread if np.isfinite(spread) else np.inf
