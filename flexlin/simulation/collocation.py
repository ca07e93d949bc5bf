"""Collocation on windows of time whose steps follow the motion: the integrator of the closed loop."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.simulation.beside import LinearPath
from flexlin.simulation.equations import Equations
from flexlin.simulation.stepping import GENTLER, SHORTER, stopped
from flexlin.simulation.sweeps import Solved, Start, solve_window
from flexlin.simulation.window import Grid, Path, between

LARGEST_WINDOW = 32
"""Steps of a window at the most; the number is a power of two, because each number needs a mapped function of its own."""
WINDOW_BYTES = 2**24
"""The stage matrices of a window take at most this many bytes."""
FIRST_STEPS = 256
"""Steps that a period would take at the length that is tried first."""
FEW = 4
"""Steps of the first window behind a start or a break, where fast modes ring; windows as short try sturdier sweeps."""
MANY_SWEEPS = 6
"""Sweeps after which windows grow no further, and begin from better slopes."""
ESTIMATE = 10.0
"""The local estimate is of the order of the motion between the edges; it may be this many times the tolerance."""
ABSOLUTE = 1e-2
"""States below this (rad, m and their rates) are resolved to this times the tolerance."""
MOST_STEPS = 200_000
"""Steps, refused ones counted, after which a simulation is given up."""
EVEN, EXCESS = 10.0, 4.0
"""Periods after which the steps that are needed are foreseen, and how many times too many end the simulation."""
SHORTEST = 1e-13
"""A step this short against the whole time is no step any more."""
NEARLY = 1e-3
"""Steps that leave less than this part of the way to the mark go on to it: rounding could be all that is left."""
SAFETY = 0.9
"""The next step is this much shorter than the estimate would have it."""
GROWTH = (0.02, 4.0)
"""By how much the next step may be shorter or longer."""
FURTHER = 1.3
"""How much further windows reach, one after another, behind one whose sweeps did not settle."""
LONGEST = 5.0
"""How much longer the last step of a window may be than its first."""
RINGING = 1.15
"""How much longer each step behind a break is than the last."""
INSIDE = 1e-13
"""A break of the motion is looked at from so far before it, relative to the period."""

Accept = Callable[[Array, Array, Array], None]
"""Looks at times (N,) and states (N, 2n) that were reached, and the torque (.., m) at the stages before; raises if they must not be."""
Hurries = Callable[[Grid, Path], Array]
"""How many times too long each step (K,) of a window is for what it passes."""


@dataclass
class Progress:
    """Where an integration stands.

    t, x, work: what was reached; before: the acceleration there, None behind a break; behind, first: whether
    a break was just passed, and the step that held behind the last one; largest: of each state so far; h, count: the
    step and how many of them come next; begin: how the sweeps begin, since deviations of size `far`; reach: the longest
    window since one that did not settle; linear: the linear answer, where it is wanted too.
    """

    t: float
    x: Array
    work: float
    largest: Array
    h: float
    count: int = FEW
    before: Array | None = None
    behind: bool = True
    first: float = np.inf
    begin: Start = Start.RIGID
    far: float = 0.0
    reach: float = np.inf
    steps: int = 0
    growth: float = 1.0
    linear: LinearPath | None = None

    def behind_break(self, most: int) -> None:
        """Behind a break fast modes ring, as they did behind the last one."""
        known = np.isfinite(self.first)
        self.before, self.behind, self.h = None, True, min(self.h, self.first)
        self.count, self.growth = (min(2 * FEW, most), RINGING) if known else (min(FEW, most), 1.0)

    def shorten(self, grid: Grid) -> None:
        """A window that did not settle: fewer steps, or where they are few already shorter ones; later windows reach hardly further."""
        few = grid.count <= FEW
        self.growth, self.h = 1.0, float(grid.h[0]) / (4 if few else 1)
        self.count = grid.count if few else grid.count // 4
        self.reach = float(grid.h.sum()) / 2

    def keep_within_reach(self) -> None:
        """Behind a window that settled: the next one reaches a little further at the most than those since one that did not."""
        self.reach *= FURTHER
        while self.count > 1 and self.count * self.h > self.reach:
            self.count //= 2
        self.h = min(self.h, self.reach)


class Collocation:
    """Radau IIA collocation with s stages: L-stable, so modes that no step follows are damped, and of order 2 s - 1 at the edges.

    Steps are solved many at a time (`sweeps`) and kept as far as their local error allows.
    Source: Hairer, Wanner, Solving ODEs II, IV.8.
    """

    def __init__(
        self,
        equations: Equations,
        period: float,
        stages: int,
        tol: float,
        accept: Accept | None = None,
        hurries: Hurries | None = None,
    ):
        self._equations, self._period, self._stages, self._tol = equations, period, stages, tol
        self._accept, self._hurries = accept or (lambda t, x, torque: None), hurries

    def integrate(self, t: Array, start: Array, marks: Array, linear: bool = False) -> Array:
        """States and work (N, 2n + 1) at times t; marks (K,), from the first to the last time, are edges of steps.

        With `linear`, the 2n states of the linear equations on the same steps follow, (N, 4n + 1); the steps are short enough for both.

        Raises: SimulationStopped where no step is short enough or too many are needed; TooLarge when one step's matrices would not fit.
        """
        n = len(start) // 2
        size = 8 * (self._stages * n) ** 2
        check_size("a simulation step", 4 * size, "use fewer elastic coordinates")
        most = 2 ** int(np.log2(np.clip(WINDOW_BYTES // size, 1, LARGEST_WINDOW)))
        at = Progress(float(t[0]), start, 0.0, np.abs(start), self._period / FIRST_STEPS)
        at.linear = LinearPath(start) if linear else None
        out, done = np.empty((len(t), 2 * n + 1 + 2 * n * linear)), 1
        out[0] = np.concatenate([start, [0.0], start if linear else []])
        for mark in marks[1:]:
            at.behind_break(most)
            while at.t < mark:
                self._foresee(at, at.t - float(t[0]), float(t[-1] - t[0]))
                window = self._advance(at, float(mark), float(t[-1] - t[0]), most)
                if window is None:
                    continue
                grid, path, power, beside = window
                stop = int(np.searchsorted(t, at.t, side="right"))
                states, work = between(grid, path, power, t[done:stop])
                out[done:stop, : 2 * n + 1] = np.column_stack([states, at.work + work])
                if beside is not None:
                    out[done:stop, 2 * n + 1 :] = LinearPath.states(grid, beside, t[done:stop])
                at.work += float(grid.h @ (power @ grid.rule.tableau.b))
                done = stop
        return out

    def _foresee(self, at: Progress, passed: float, whole: float) -> None:
        """Give up where too many steps were taken, or would be: some periods show how many the whole time needs."""
        even = passed > EVEN * self._period
        if even and at.steps > MOST_STEPS / 100 and at.steps * whole > EXCESS * MOST_STEPS * passed:
            needed = f"about {at.steps * whole / passed:.1g} steps would be needed, at most {MOST_STEPS} are taken"
            raise stopped(at.t, needed, at.x, SHORTER)
        if at.steps > MOST_STEPS:
            raise stopped(at.t, f"{MOST_STEPS} steps were not enough", at.x, SHORTER if even else GENTLER)

    def _advance(
        self, at: Progress, mark: float, whole: float, most: int
    ) -> tuple[Grid, Path, Array, Path | None] | None:
        """Try a window: the steps of it that hold, and `at` moved to their end; None where none does, and `at` has shorter steps."""
        grid = next_grid(at, mark, self._stages)
        at.steps += grid.count
        if grid.h.min() < SHORTEST * whole:
            raise stopped(at.t, "no step is short enough", at.x)
        scale = np.maximum(at.largest, ABSOLUTE)
        solved = self._solve(at, grid, scale)
        if solved is None:
            at.shorten(grid)
            return None
        estimate = np.abs(solved.window.local_errors(solved.path, self._acceleration(at)) / scale).max(axis=1)
        beside = None
        if at.linear is not None:
            beside, missed = at.linear.on(solved.rigid, solved.at, ABSOLUTE)
            estimate = np.maximum(estimate, missed.max(axis=1))
        ratio = estimate / (ESTIMATE * self._tol)
        if self._hurries is not None:
            ratio = np.maximum(ratio, self._hurries(grid, solved.path) ** (grid.stages + 1))
        good = adapt(at, grid, ratio, most)
        at.keep_within_reach()
        if not good:
            return None
        if at.behind:
            at.first, at.behind = float(grid.h[0]), False
        part, path = grid.first(good), solved.path.first(good)
        self._accept(part.edges[1:], path.x[1:], solved.torque[:good])
        at.t, at.x, at.before = float(part.edges[-1]), path.x[-1], path.w[-1, -1]
        at.largest = np.maximum(at.largest, np.abs(path.x).max(axis=0))
        if at.linear is not None and beside is not None:
            beside = beside.first(good)
            at.linear.accept(beside)
        return part, path, solved.power[:good], beside

    def _solve(self, at: Progress, grid: Grid, scale: Array) -> Solved | None:
        """The motion on the grid, by the cheapest start of the sweeps that leads to it."""
        size = float(np.abs(at.x[: len(at.x) // 2]).max())
        if size < 0.5 * at.far:
            at.begin = Start.RIGID
        inside, before = INSIDE * self._period, self._acceleration(at)
        for begin in list(Start)[at.begin :]:
            solved = solve_window(self._equations, grid, at.x, before, scale, self._tol, begin, inside)
            if solved is not None:
                if begin > at.begin or (begin is Start.RIGID and solved.sweeps > MANY_SWEEPS):
                    at.begin, at.far = max(begin, Start.SHIFTED), size
                return solved
            if grid.count > FEW:
                return None
        return None

    def _acceleration(self, at: Progress) -> Array:
        """The acceleration (n,) from which the window starts."""
        if at.before is None:
            n = len(at.x) // 2
            places = self._equations.places(np.array([at.t + INSIDE * self._period]))
            y, v, w = at.x[None, :n], at.x[None, n:], np.zeros((1, n))
            F = self._equations.residual(places, y, v, w)[0][0]
            at.before = -np.linalg.solve(self._equations.mass(places, y)[0], F)
            if at.linear is not None:
                at.linear.behind_break(places)
        return at.before


def next_grid(at: Progress, mark: float, stages: int) -> Grid:
    """The steps to try next: from `at.h` on, each `at.growth` times the last; moved to the mark where they pass or nearly reach it."""
    count = at.count
    edges = np.append(0.0, np.cumsum(at.h * at.growth ** np.arange(count)))
    if edges[-1] < (1 - NEARLY) * (mark - at.t):
        return Grid(at.t + edges, stages)
    while count > 1 and edges[count // 2] >= mark - at.t:
        count //= 2
    edges = at.t + edges[: count + 1] * ((mark - at.t) / edges[count])
    edges[-1] = mark
    return Grid(edges, stages)


def adapt(at: Progress, grid: Grid, ratio: Array, most: int) -> int:
    """How many of the steps hold, from their error against the allowed one; sets length, growth and number of the next ones."""
    with np.errstate(divide="ignore"):
        factor = np.clip(SAFETY * ratio ** (-1 / (grid.stages + 1)), *GROWTH)
    wanted = grid.h * np.where(np.isfinite(ratio), factor, GROWTH[0])
    refused, half = ~(ratio <= 1), grid.count // 2
    if refused.any():
        good = int(np.argmax(refused))
        at.h, at.growth, at.count = float(wanted[good]), 1.0, min(most, max(FEW // 2, grid.count // 2))
        return good
    at.count = min(most, 2 * grid.count)
    trend = (wanted[half:].min() / wanted[: half or 1].min()) ** (1 / max(half, 1))
    at.growth = float(np.clip(trend, 1.0, LONGEST ** (1 / at.count)))
    at.h = float(wanted[half:].min())
    return grid.count
