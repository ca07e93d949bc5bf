"""Exponents of many values together by NumPy, in batches of bounded memory."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from flexlin.about.free import ParametricLoop
from flexlin.answers.sweep.found import Found
from flexlin.answers.sweep.plan import HARMONICS, SLACK, Plan
from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries
from flexlin.periodic.many.algebra import solve_positive
from flexlin.periodic.many.extrapolation import measure_spread
from flexlin.periodic.many.romberg import batched_exponents

CHUNK_BYTES = 2**26
"""Working memory of one batch."""
MOST_TOGETHER = 1024
"""Values of a block at the most: so large that no time is lost, so small that progress is seen and work can be shared out."""
STARTS = (8, 12, 16, 24, 32, 48, 64, 96, 128)
"""Numbers of segments among which the pilot chooses."""
ORDER = 8
"""Of the extrapolated logs, by the length of the segments."""
PILOTS, ENOUGH = 24, 0.9
"""Values on which the pilot runs, and the share of them that must reach the tolerance."""
TAIL = 1e-4
"""The two highest harmonics of a representation must be this small against the coefficients, in units of the tolerance."""
STRAY, LOOKED = np.array([0.1372, 0.4142, 0.7709]), 8
"""Phases between its samples, and values, at which a representation is held against the coefficients: samples take a high harmonic for a
low one."""


@dataclass(frozen=True)
class Batches:
    """The batched computation over chosen points."""

    loop: ParametricLoop
    points: Array
    tol: float
    chunk_bytes: int
    whole: dict[int, tuple[Array, Array, Array, Plan]] = field(default_factory=dict, compare=False)

    def fill(self, found: Found, which: Array, plan: "Plan") -> None:
        """Compute the values `which`: together, those that missed tol again on twice the segments, and the rest one by one."""
        found.period[which] = self.loop.periods(self.points[which])
        narrow = self.find_narrow(which)
        alone, which = which[narrow], which[~narrow]
        for trial in (plan, replace(plan, segments=2 * plan.segments)) if len(which) else ():
            size = self.values_in_chunk(trial.segments)
            parts = [which[i : i + size] for i in range(0, len(which), size)]
            left = [self.try_together(found, part, trial) for part in parts]
            which = np.concatenate([which[:0], *left])
        for i in (*alone, *which):
            found.put_alone(i, partial(self.loop.system_at, self.points[i]), self.tol)

    def find_narrow(self, which: Array) -> Array:
        """Which values have coefficients with narrow features, which a batch would step over."""
        if not self.loop.linearization.may_be_narrow:
            return np.zeros(len(which), dtype=bool)
        return np.array([bool(self.loop.at(self.points[i]).features) for i in which], dtype=bool)

    def try_together(self, found: Found, which: Array, plan: "Plan") -> Array:
        """Enter the values that reach tol; return those that do not."""
        logs, errors, reached, _ = self.batch(which, plan)
        T = found.period[which, None]
        found.put(which[reached], (logs / T)[reached], (errors / T)[reached])
        return which[~reached]

    def batch(self, which: Array, plan: "Plan") -> tuple[Array, Array, Array, "Plan"]:
        """Logs (V, n) of the multipliers, their errors, whether they meet tol, and the plan with what was learnt."""
        if len(which) == len(self.points) and plan.segments in self.whole:
            return self.whole[plan.segments]  # the pilot saw all values
        points = self.points[which]
        T = self.loop.periods(points)
        coefficients, usable, harmonics = prepare_coefficients(self.loop, points, T, plan, self.tol)
        result = batched_exponents(
            coefficients, plan.segments, self.loop.phase_breaks, self.tol / 100, SLACK * plan.spread, self.loop.memory
        )
        logs, errors = result.logs.T, result.errors.T
        allowed = self.tol * np.maximum(T[:, None], np.abs(logs))
        reached = usable & result.sound & np.all(errors <= allowed, axis=1)
        learnt = replace(plan, harmonics=harmonics, spread=measure_spread(result.logs[:, reached]))
        if len(which) == len(self.points):
            self.whole[plan.segments] = logs, errors, reached, learnt
        return logs, errors, reached, learnt

    def values_in_chunk(self, segments: int) -> int:
        """How many values a batch may hold: coefficients at the nodes of the finest resolution, its factors, and copies of both."""
        n, pieces = self.loop.coordinates, segments + len(self.loop.phase_breaks)
        nodes, factors = 8 * pieces, 4 * pieces
        return max(1, int(self.chunk_bytes // (8 * (3 * nodes * 2 * n * n + 5 * factors * 4 * n * n))))


def choose_plan(batches: Batches) -> Plan:
    """The least number of segments on which a few values, spread over all, reach the tolerance."""
    plan = try_plans(batches, STARTS[-1], ENOUGH)
    assert plan is not None
    return plan


def try_plans(batches: Batches, most: int, enough: float) -> Plan | None:
    """The least number of segments on which a share of the values reaches the tolerance, None where that is more than `most`.

    Numbers that the error of the last trial rules out are left out.
    """
    plan = Plan(STARTS[0])
    while True:
        some = min(PILOTS, batches.values_in_chunk(plan.segments))
        which = np.unique(np.linspace(0, len(batches.points) - 1, some).round().astype(int))
        logs, errors, reached, plan = batches.batch(which, replace(plan, spread=np.inf))
        if reached.mean() >= enough or plan.segments == STARTS[-1]:
            return plan
        allowed = batches.tol * np.maximum(batches.loop.periods(batches.points[which])[:, None], np.abs(logs))
        missed = float(np.quantile(np.nan_to_num((errors / allowed).max(axis=1), nan=1.0), enough))
        wanted = plan.segments * missed ** (1 / ORDER) if np.isfinite(missed) else 0.0
        finer = [segments for segments in STARTS if segments > plan.segments]
        plan = replace(plan, segments=max([finer[0], *(segments for segments in finer if segments <= wanted)]))
        if plan.segments > most:
            return None


def prepare_coefficients(
    loop: ParametricLoop, points: Array, T: Array, plan: Plan, tol: float
) -> tuple[Callable[[Array], tuple[Array, Array]], Array, int]:
    """X = -T^2 M^-1 K, Y = -T M^-1 D as function phases (N,) -> (N, n, n, V), where they are finite (V,), and the harmonics it took.

    Without breaks they are sampled at 2 H + 1 phases and interpolated by their Fourier series of H harmonics, once the two highest
    harmonics have vanished and the series holds between the samples; else, or when that needs more samples than there are nodes, they
    are evaluated at each phase asked.
    """
    n = loop.coordinates

    def exact(phases: Array, which: slice = slice(None)) -> Array:
        chosen, times = points[which], T[which]
        M, D, K = (
            np.moveaxis(A.reshape(len(phases), len(chosen), n, n), (0, 1), (2, 3)) for A in loop.sample(phases, chosen)
        )
        stacked = np.concatenate([times * K, D], axis=1).reshape(n, 2 * n, -1)
        Z = solve_positive(M.reshape(n, n, -1), stacked)
        return np.moveaxis(Z.reshape(n, 2 * n, len(phases), -1), 2, 0) * -times

    def holds(series: FourierSeries) -> bool:
        some = slice(None, None, max(1, len(points) // LOOKED))
        with np.errstate(invalid="ignore"):
            apart = np.abs(series(STRAY)[..., some] - exact(STRAY, some))
        return float(np.nanmax(apart, initial=0.0)) <= max(100 * TAIL * tol, 1e-12) * float(np.abs(series.values).max())

    def split(Z: Array) -> tuple[Array, Array]:
        return Z[:, :, :n], Z[:, :, n:]

    usable: Array = np.ones(len(points), dtype=bool)
    if not loop.phase_breaks:
        for harmonics in (h for h in HARMONICS if plan.harmonics <= h < 4 * plan.segments):
            Z = exact(np.arange(2 * harmonics + 1) / (2 * harmonics + 1))
            usable = np.asarray(np.isfinite(Z).all(axis=(0, 1, 2)))
            Z[..., ~usable] = 0.0
            series = FourierSeries.through(Z, 1.0)
            if series.tail <= max(TAIL * tol, 3e-15) and holds(series):
                return lambda phases, series=series: split(series(phases)), usable, harmonics
    return lambda phases: split(np.nan_to_num(exact(phases))), usable, HARMONICS[-1]


@dataclass(frozen=True)
class NumpyBatches:
    """The computation of blocks of values by NumPy."""

    loop: ParametricLoop
    tol: float
    chunk_bytes: int
    plan: Plan
    route = "numpy"
    threaded = False

    @classmethod
    def prepare(cls, loop: ParametricLoop, points: Array, tol: float, chunk_bytes: int) -> "NumpyBatches":
        """Choose the number of segments on a few values."""
        return cls(loop, tol, chunk_bytes, choose_plan(Batches(loop, points, tol, chunk_bytes)))

    @property
    def block(self) -> int:
        """Values of a block."""
        size = Batches(self.loop, np.zeros((0, 0)), self.tol, self.chunk_bytes).values_in_chunk(self.plan.segments)
        return min(MOST_TOGETHER, size)

    def compute(self, points: Array) -> Found:
        """All values of a block."""
        found = Found.empty(len(points), self.loop.states)
        Batches(self.loop, points, self.tol, self.chunk_bytes).fill(found, np.arange(len(points)), self.plan)
        return found
