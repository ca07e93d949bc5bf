"""A window of time: several collocation steps at once, whose linear equations are factored together in compiled code."""

from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np

from flexlin._core import addresses, declare
from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.periodic.transition.factors import factor_accelerations_in_core, kept_numbers, tabulate
from flexlin.periodic.transition.gauss import Tableau, radau
from flexlin.precision import MINOR
from flexlin.program import POINTS_TOGETHER, Layout

MOST_SWEEPS = 14
"""Sweeps after which a window is given up, and made shorter."""
SLOW_SWEEP = 0.4
"""A sweep that leaves more of the last one's change than this calls for the slopes of where it is."""
GROWN_CHANGE = 2.0
"""A sweep that enlarges the change so much leads nowhere."""
SWEEP_SHARE = 0.02
"""The share of the tolerance that the sweeps may leave over."""
STALLED_SHARE = MINOR
"""The share of the tolerance at which rounding may stop the sweeps."""
LEAST_CHANGE = 0.01
"""A sweep is not believed to leave less of the last one's change than this."""
RULE = np.array([SLOW_SWEEP, SWEEP_SHARE, STALLED_SHARE, LEAST_CHANGE, GROWN_CHANGE, MOST_SWEEPS])

sweep_steps = declare(
    "int sweep_steps(int m, int stages, int steps, int inputs, const double *lengths, const double *tableau, double *kept, "
    "const double *by_start, const double *Phi, const double *gain, const double *offset, const double *start, const double *scale, "
    "double tol, const double *rule, int known, int once, long count, const Step *code, const double *const *in, const long *rows, "
    "double *const *out, const long *sizes, double *work, double *state, double *F, double *torque, double *x, double *y, double *v, "
    "double *w)",
    lambda m, s, K, inputs, *rest: (
        *(K, 2 * s * (s + 1), kept_numbers(m, s, K), (K, s * m, 2 * m), (K, 2 * m, 2 * m)),
        *((K * s, inputs, 2 * m), (K * s, inputs), 2 * m, 2 * m, 6, (rest[13], 4), None, None, None, 2),
        *((K * s, m), (K * s, inputs), (K + 1, 2 * m), (K, s, m), (K, s, m), (K, s, m)),
    ),
    optional=("code", "rows", "sizes", "work"),
)
read_steps = declare(
    "void read_steps(int m, int stages, int steps, long points, const double *edges, const double *tableau, const double *powers, "
    "const double *x, const double *w, const double *power, const double *t, double *states, double *work)",
    lambda m, s, K, N, *_: (*(K + 1, 2 * s * (s + 1), (s, s), (K + 1, 2 * m), (K, s, m), (K, s), N, (N, 2 * m), N),),
)


class Found(IntEnum):
    """What became of sweeps."""

    ONGOING, SETTLED, SLOW, LOST = range(4)


@dataclass(frozen=True)
class Ready:
    """A residual that compiled code carries out: its program, and what it takes of the motion at the stages."""

    layout: Layout
    place: list[Array]

    @lazy
    def work(self) -> Array:
        """Room for the values of the program."""
        return np.empty(max(1, self.layout.slots) * POINTS_TOGETHER)


@dataclass(frozen=True)
class Rule:
    """The Radau IIA method with s stages: L-stable, order 2 s - 1; its last stage is the step's end.

    table: as compiled code takes it; to_start: the stages' Lagrange polynomials at the step's beginning (s,);
    powers: (s, s), values at the stages -> coefficients of the polynomial through them.
    """

    tableau: Tableau
    table: Array
    to_start: Array
    powers: Array

    @staticmethod
    @lru_cache(maxsize=16)
    def of(stages: int) -> "Rule":
        """The rule, made once."""
        tableau = radau(stages)
        powers = np.ascontiguousarray(np.linalg.inv(np.vander(tableau.c, stages, increasing=True)))
        return Rule(tableau, tabulate(tableau, True), powers[0].copy(), powers)


@dataclass(frozen=True)
class Path:
    """A motion on a window: states x (K + 1, 2n) at the edges; y, v = y', w = y'' (K, s, n) at the stages of each step."""

    x: Array
    y: Array
    v: Array
    w: Array

    @property
    def stages(self) -> tuple[Array, Array, Array]:
        """y, y', y'' (K s, n) of all stages."""
        n = self.w.shape[-1]
        return self.y.reshape(-1, n), self.v.reshape(-1, n), self.w.reshape(-1, n)

    def first(self, count: int) -> "Path":
        """The first steps of it."""
        return Path(self.x[: count + 1], self.y[:count], self.v[:count], self.w[:count])


@dataclass(frozen=True)
class Grid:
    """Steps between increasing edges (K + 1,), with the stages of Radau's method in each."""

    edges: Array
    stages: int

    @property
    def rule(self) -> Rule:
        """The method."""
        return Rule.of(self.stages)

    @property
    def count(self) -> int:
        """The number of steps."""
        return len(self.edges) - 1

    @lazy
    def h(self) -> Array:
        """The lengths of the steps (K,)."""
        return self.edges[1:] - self.edges[:-1]

    @property
    def times(self) -> Array:
        """The times (K, s) of all stages."""
        return self.edges[:-1, None] + self.h[:, None] * self.rule.tableau.c

    def first(self, count: int) -> "Grid":
        """The first steps of it."""
        return self if count == self.count else Grid(self.edges[: count + 1], self.stages)

    def path(self, x: Array, w: Array) -> Path:
        """The motion that states at the edges and accelerations at the stages make.

        v_i = v_0 + h sum_j a_ij w_j,   y_i = y_0 + h c_i v_0 + h^2 sum_j (a^2)_ij w_j
        """
        method, h, n = self.rule.tableau, self.h[:, None, None], w.shape[2]
        place, rate, moved = x[:-1, None, :n], x[:-1, None, n:], method.a @ w
        y, v = place + h * (method.c[:, None] * rate + h * (method.a @ moved)), rate + h * moved
        return Path(x, y, v, w)

    def rest(self, y: Array) -> Path:
        """The arm at rest in y (n,) at all times."""
        zeros = np.zeros((self.count, self.stages, len(y)))
        x = np.zeros((self.count + 1, 2 * len(y)))
        x[:, : len(y)] = y
        return Path(x, zeros + y, zeros.copy(), zeros)

    def coasting(self, x: Array, w: Array) -> Path:
        """The arm that goes on from a state (2n,) with the acceleration w (n,) it has."""
        t, v = (self.edges - self.edges[0])[:, None], x[len(w) :]
        edges = np.concatenate([x[: len(w)] + t * (v + t / 2 * w), v + t * w], axis=1)
        return self.path(edges, np.tile(w, (self.count, self.stages, 1)))


class Window:
    """The linear equations M w + D v + K y = -F on a grid, collocated in the accelerations w.

    M, D, K: (K s, n, n) at the stages. kept, by_start, transition: of compiled code. `sound`:
    whether they can be solved; rows are not exchanged, which steps short enough do not need.
    Source: Hairer, Norsett, Wanner, Solving ODEs I, II.14; Solving ODEs II, IV.8.
    """

    def __init__(self, grid: Grid, M: Array, D: Array, K: Array):
        n, s, count = M.shape[-1], grid.stages, grid.count
        self.grid, self.n, self._blocks = grid, n, np.empty((count, s, n, 3 * n))
        np.concatenate([M, D, K], axis=2, out=self._blocks.reshape(-1, n, 3 * n))
        self.kept, good = np.empty(kept_numbers(n, s, count)), np.empty(count, np.intc)
        self.by_start, self.transition = np.empty((count, s * n, 2 * n)), np.empty((count, 2 * n, 2 * n))
        given = n, s, count, self._blocks, grid.h, grid.rule.table
        factor_accelerations_in_core(*given, self.kept, self.by_start, self.transition, good)
        self.sound = bool(good.all())

    def first(self, grid: Grid) -> "Window":
        """The same on a grid of the first steps."""
        n, s, count, part = self.n, grid.stages, grid.count, object.__new__(Window)
        vars(part).update(grid=grid, n=n, _blocks=self._blocks[:count], kept=self.kept[: kept_numbers(n, s, count)])
        vars(part).update(by_start=self.by_start[:count], transition=self.transition[:count], sound=self.sound)
        return part

    def corrected(self, path: Path, start: Array, F: Array) -> Path:
        """Newton's step from a path whose residuals are F (K s, n) to one that begins at `start`; the path itself is changed."""
        n, points = self.n, len(F)
        none, every = np.empty((points, 0)), np.ones(2 * n)
        Sweeps(self, path, start, every, np.empty((points, 0, 2 * n)), none, F).go_on(None, np.inf, known=True)
        return path

    def local_errors(self, path: Path, before: Array) -> Array:
        """An estimate (K, 2n) of each step's error: how far the stages miss the rate at the step's beginning, filtered.

            e = (I - g h J)^-1 g h (x'(0) - sum_j l_j(0) x'_j),   g = 1 / (s + 1)

        It is O(h^(s + 1)), the order of the motion between the edges. before: the acceleration (n,) at the beginning of the window.
        Source: Hairer, Wanner, Solving ODEs II, IV.8, Eq. (8.19).
        """
        grid, to_start = self.grid, self.grid.rule.to_start
        M, D, K = np.split(self._blocks[:, 0], 3, axis=2)
        g, last = grid.h[:, None, None] / (grid.stages + 1), np.concatenate([before[None], path.w[:-1, -1]])
        with np.errstate(over="ignore", invalid="ignore"):
            apart = (path.x[:-1, self.n :] - to_start @ path.v)[..., None]
            missed = (last - to_start @ path.w)[..., None]
            try:
                rates = np.linalg.solve(M + g * (D + g * K), g * (M @ missed - g * (K @ apart)))
            except np.linalg.LinAlgError:  # no length of a step is as unlucky twice
                rates = np.full_like(apart, np.inf)
            return np.concatenate([g * (rates + apart), rates], axis=1)[..., 0]


@dataclass
class Sweeps:
    """Newton's sweeps over a window: its motion from `start`, which each of them corrects.

    gain (K s, m, 2n), offset (K s, m): of the law, by which the torque follows from the motion; F (K s, n): the residuals;
    scale (2n,): what tol is relative to; torque (K s, m): of the motion that has settled.
    """

    window: Window
    path: Path
    start: Array
    scale: Array
    gain: Array
    offset: Array
    F: Array

    def __post_init__(self) -> None:
        self.torque, self.state = np.empty_like(self.offset), np.zeros(2)

    @property
    def made(self) -> int:
        """How many sweeps were made."""
        return int(self.state[0])

    def go_on(self, residual: Ready | None, tol: float, known: bool, once: bool = False) -> Found:
        """Sweep until the motion has settled, or other factors are called for; once where residuals come from elsewhere.

        known: whether F holds the residuals of the motion already. Raises: MemoryError.
        """
        window, grid, path = self.window, self.window.grid, self.path
        shared: tuple[Any, ...] = (0, None, None, None, None, None, None)
        if residual is not None:
            code = residual.layout
            read = addresses([path.y, path.v, path.w, self.torque, *residual.place])
            written = addresses([self.F], written=True)
            shared = (len(code.steps), code.steps, read, code.rows, written, code.sizes, residual.work)
        return Found(
            sweep_steps(
                *(window.n, grid.stages, grid.count, self.offset.shape[1], grid.h, grid.rule.table, window.kept),
                *(window.by_start, window.transition, self.gain, self.offset, self.start, self.scale, tol, RULE),
                *(int(known), int(once), *shared, self.state, self.F, self.torque, path.x, path.y, path.v, path.w),
            )
        )


def between(grid: Grid, path: Path, power: Array, t: Array) -> tuple[Array, Array]:
    """States (N, 2n) at times t of a grid, and the work (N,) done since its beginning, by the collocation polynomials.

    power: (K, s), the rate of the work at the stages.
    """
    n, rule = path.w.shape[-1], grid.rule
    states, work = np.empty((len(t), 2 * n)), np.empty(len(t))
    read_steps(
        *(n, grid.stages, grid.count, len(t), grid.edges, rule.table, rule.powers, path.x, path.w),
        *(np.ascontiguousarray(power), np.ascontiguousarray(t), states, work),
    )
    return states, work
