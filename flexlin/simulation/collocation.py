"""Collocation on windows of time whose steps follow the motion: the integrator of the loop, and the linear prediction beside it."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from flexlin.checks import Array, check_size
from flexlin.errors import NumericalError
from flexlin.linearization.law import Law
from flexlin.linearization.linearization import Linearization
from flexlin.simulation.equations import LinearEquations, Places, from_coordinates, solve_acceleration, to_coordinates
from flexlin.simulation.events import Event, Events
from flexlin.simulation.mesh import BREAK_DISTANCE, Mesh, Trail, find_rough_times, mark_times
from flexlin.simulation.stopping import GENTLER, SHORTER, SHORTEST_STEP, stopped
from flexlin.simulation.sweeps import Rigid, Solved, Start, solve_window
from flexlin.simulation.window import Grid, Path, between

LARGEST_WINDOW = 64
"""Steps of a window at the most."""
WINDOW_BYTES = 2**19
"""The stage matrices of a window take at most this many bytes, which a processor keeps at hand."""
FEW_STEPS = 4
"""Windows of so few steps try sturdier sweeps."""
MANY_SWEEPS = 6
"""Sweeps after which windows grow no further, and begin from better slopes."""
ABSOLUTE_STATE = 1e-2
"""States below this (rad, m and their rates) are resolved to this times the tolerance."""
MOST_STEPS = 200_000
"""Steps, refused ones counted, after which a simulation is given up."""
FORESEEN_PERIODS, EXCESS_STEPS = 10.0, 4.0
"""Periods after which the steps that are needed are foreseen, and how many times too many end the simulation."""
WINDOW_GROWTH = 1.3
"""How much further windows reach, one after another, behind one whose sweeps did not settle."""
Accept = Callable[[Array, Array, Array], None]
"""Looks at times (N,) and states (N, 2n) that were reached, and the torque (.., m) at the stages before; raises if they must not be."""
Hurries = Callable[[Grid, Path], Array]
"""How many times too long each step (K,) of a window is for what it passes."""
LEAST_RUN_TOL = 1e-12
"""A tolerance below this is not asked of a run."""
RUNS = ((7, 4.0), (8, 0.4))
"""Stages and tolerance of a step, over that of the whole, of the two runs that are compared: other steps, other places, another order.

A step's error estimate is of order s + 1, what it leaves at its end of order 2 s - 1: of all shipped scenes the second run ends within
0.03 of the tolerance, and differs from the first by 0.3 of it at the most. Where deviations grow, errors add up to more."""


class LinearPath:
    """M_L y'' + D_L y' + K_L y = f along the windows of another integration, with its own error estimate.

    The sweeps of a nonlinear window begin with these matrices factored, so the linear motion is one correction from rest.
    Where it outgrows all numbers it is lost, and no step is made shorter for it.

    x: (2n,) the state reached; before: (n,) the acceleration there; largest: of each state so far.
    """

    def __init__(self, start: Array):
        self.x, self.largest, self.before = start, np.abs(start), np.zeros(len(start) // 2)

    def behind_break(self, places: Places) -> None:
        """The acceleration behind a break: `places` of that one time."""
        M, D, K = (part[0] for part in places.linear)
        n = len(self.before)
        with np.errstate(over="ignore", invalid="ignore"):
            self.before = np.linalg.solve(M, places.force[0] - D @ self.x[n:] - K @ self.x[:n])

    def on(self, about: Rigid, floor: float) -> tuple[Path, Array]:
        """The motion on a window, and its local errors (K, 2n) relative to the largest state or to `floor`."""
        with np.errstate(over="ignore", invalid="ignore"):
            path = about.window.corrected(about.grid.rest(np.zeros(len(self.before))), self.x, -about.at.force)
            errors = about.window.local_errors(path, self.before) / np.maximum(self.largest, floor)
        return path, np.where(np.isfinite(errors), np.abs(errors), 0.0)

    def accept(self, path: Path) -> None:
        """Move to the end of a path."""
        self.x, self.before = path.x[-1], path.w[-1, -1]
        self.largest = np.maximum(self.largest, np.abs(path.x).max(axis=0))


@dataclass
class Progress:
    """Where an integration stands.

    t, x, work: what was reached; before: the acceleration there, None behind a break; largest: of each state so far; mesh: how long
    steps should be from here on; count: how many come next at the most; passed, windows: meshes of what was reached, behind the last
    break from `fresh` on, and its edges and accelerations; begin: how the sweeps begin, since deviations of size `far`; reach: the
    longest window since one that did not settle; linear: the linear answer, where it is wanted too; trail: of a run before; torque: what
    was given last, (m,).
    """

    t: float
    x: Array
    work: float
    largest: Array
    mesh: Mesh
    count: int
    before: Array | None = None
    passed: list[Mesh] = field(default_factory=list)
    windows: list[tuple[Array, Array]] = field(default_factory=list)
    fresh: int = 0
    begin: Start = Start.RIGID
    far: float = 0.0
    reach: float = np.inf
    steps: int = 0
    linear: LinearPath | None = None
    trail: Trail | None = None
    torque: Array | None = None

    def behind_break(self) -> None:
        """Behind a break fast modes ring, as they did behind the last one."""
        self.before = None
        if len(self.passed) > self.fresh and self.t >= self.mesh.edges[-2]:
            self.mesh = Mesh.joined(self.passed[self.fresh :]).moved(self.t)
        self.fresh = len(self.passed)

    def learn(self, grid: Grid, ratio: Array, good: int) -> None:
        """From the errors of a window's steps against the allowed ones; the first `good` are kept."""
        known, self.mesh = self.mesh.learn(grid.edges, ratio, grid.stages + 1, good)
        if good:
            self.passed.append(known)

    def stop_at(self, event: Event, x: Array) -> None:
        """Go on from an event within the last window, in steps as long as they were to be there."""
        known = self.passed.pop()
        self.passed.append(Mesh(known.edges[: event.step + 2], known.lengths[: event.step + 1]))
        edges = np.concatenate([[event.time], known.edges[event.step + 1 : -1], self.mesh.edges])
        self.mesh = Mesh(edges, np.concatenate([known.lengths[event.step :], self.mesh.lengths]))
        self.t, self.x, self.before, self.count = event.time, x, None, max(FEW_STEPS, 2 * event.step + 2)

    def shorten(self, grid: Grid) -> None:
        """A window that did not settle: fewer steps, or where they are few already shorter ones; later windows reach hardly further."""
        if grid.count <= FEW_STEPS:
            self.mesh = self.mesh.shortened(self.t, float(grid.h[0]) / 4)
        self.count = max(FEW_STEPS, grid.count // 4)
        self.reach = float(grid.h.sum()) / 2


@dataclass(frozen=True)
class Collocation:
    """Radau IIA collocation with s stages: L-stable, so modes that no step follows are damped, and of order 2 s - 1 at the edges.

    Steps are solved many at a time (`sweeps`) and kept as far as their local error allows.
    Source: Hairer, Wanner, Solving ODEs II, IV.8.
    """

    equations: LinearEquations
    period: float
    stages: int
    tol: float
    accept: Accept = lambda t, x, torque: None
    hurries: Hurries | None = None
    events: Events | None = None

    def integrate(
        self, t: Array, start: Array, marks: Array, narrow: Array, linear: bool = False, trail: Trail | None = None
    ) -> tuple[Array, Array | None, Trail | None]:
        """States [y; y'; z] and work (N, 2n + k + 1) at times t from a start (2n + k,); what is known of the steps for another run.

        marks (K,), from the first to the last time, are edges of windows, behind which accelerations may jump; narrow: edges of steps.

        With `linear`, the states (N, 2n + k) of the linear equations on the same steps too, which are then short enough for both.

        Raises: SimulationStopped where no step is short enough or too many are needed; TooLarge when one step's matrices would not fit.
        """
        start, n = to_coordinates(start, self.equations.n), self.equations.n + self.equations.k
        size = 8 * (self.stages * n) ** 2
        check_size("a simulation step", 4 * size, "use fewer elastic coordinates")
        most = int(np.clip(WINDOW_BYTES // size, 1, LARGEST_WINDOW))
        fresh = Mesh.graded(float(t[0]), self.period, self.stages, self.tol)
        mesh = fresh if trail is None else trail.mesh_for(self.tol, self.stages)
        at = Progress(float(t[0]), start, 0.0, np.abs(start), mesh, most, trail=trail)
        at.linear = LinearPath(start) if linear else None
        out, done = np.empty((len(t), 2 * n + 1 + 2 * n * linear)), int(np.searchsorted(t, t[0], side="right"))
        out[:done] = np.concatenate([start, [0.0], start if linear else []])
        for mark in marks[1:]:
            at.behind_break()
            if self.events is not None:
                self.events.pass_break(at.t, at.x, at.torque)
            while at.t < mark:
                self._foresee(at, at.t - float(t[0]), float(t[-1] - t[0]))
                window = self._advance(at, float(mark), float(t[-1] - t[0]), most, narrow)
                if window is None:
                    continue
                grid, path, power, beside = window
                stop = int(np.searchsorted(t, at.t, side="right"))
                states, work = between(grid, path, power, np.append(t[done:stop], at.t))
                out[done:stop, : 2 * n + 1] = np.column_stack([states, at.work + work])[:-1]
                if beside is not None:
                    out[done:stop, 2 * n + 1 :] = between(grid, beside, np.zeros_like(power), t[done:stop])[0]
                at.work += float(work[-1])
                done = stop
        whole_trail = at.windows and self.events is None
        parts = np.split(out, [2 * n + 1], axis=1)
        z, along = (from_coordinates(part, self.equations.n, self.equations.k) for part in parts)
        return z, along if linear else None, Trail.of(at.passed, at.windows, self.tol) if whole_trail else None

    def _foresee(self, at: Progress, passed: float, whole: float) -> None:
        """Give up where too many steps were taken, or would be: some periods show how many the whole time needs."""
        even = passed > FORESEEN_PERIODS * self.period
        if even and at.steps > MOST_STEPS / 100 and at.steps * whole > EXCESS_STEPS * MOST_STEPS * passed:
            needed = f"about {at.steps * whole / passed:.1g} steps would be needed, at most {MOST_STEPS} are taken"
            raise stopped(at.t, needed, at.x, SHORTER)
        if at.steps > MOST_STEPS:
            raise stopped(at.t, f"{MOST_STEPS} steps were not enough", at.x, SHORTER if even else GENTLER)

    def _advance(
        self, at: Progress, mark: float, whole: float, most: int, narrow: Array
    ) -> tuple[Grid, Path, Array, Path | None] | None:
        """Try a window: the steps of it that hold, and `at` moved to their end; None where none does, and `at` has shorter steps."""
        grid = Grid(at.mesh.next_edges(at.t, mark, at.count, at.reach, narrow), self.stages)
        at.steps += grid.count
        if grid.h.min() < SHORTEST_STEP * whole:
            raise stopped(at.t, "no step is short enough", at.x)
        about, before = Rigid.of(self.equations, grid, BREAK_DISTANCE * self.period), self._acceleration(at)
        tried, ratio, beside, scale = grid, np.zeros(grid.count), None, np.maximum(at.largest, ABSOLUTE_STATE)
        if at.linear is not None:
            beside, missed = at.linear.on(about, ABSOLUTE_STATE)
            ratio = missed.max(axis=1) / self.tol
            good = first_refused(ratio)
            if good <= grid.count // 2:
                at.learn(grid, ratio, 0)
                return None
            about, grid = about.first(good), grid.first(good)
        solved = self._solve(at, about, before, scale)
        if solved is None:
            at.shorten(grid)
            return None
        estimate = np.abs(solved.window.local_errors(solved.path, before) / scale).max(axis=1)
        ratio[: grid.count] = np.maximum(ratio[: grid.count], estimate / self.tol)
        if self.hurries is not None:
            hurried = self.hurries(grid, solved.path) ** (grid.stages + 1)
            ratio[: grid.count] = np.maximum(ratio[: grid.count], hurried)
        good = first_refused(ratio)
        at.learn(tried, ratio, good)
        held = at.count if good == tried.count else good
        at.count, at.reach = min(most, max(FEW_STEPS, 2 * held)), at.reach * WINDOW_GROWTH
        if not good:
            return None
        part, path, begin = grid.first(good), solved.path.first(good), at.t
        event = None
        if self.events is not None:
            event = self.events.first(part, path, about.first(good).at)
        if event is not None:
            part, path = part.first(event.step + 1), path.first(event.step + 1)
        edges, x, power = part.edges[1:].copy(), path.x[1:].copy(), solved.power[: part.count]
        if event is not None:
            edges[-1], x[-1] = event.time, between(part, path, power, np.array([event.time]))[0][0]
        at.windows.append((part.edges, path.w))
        self.accept(edges, x, solved.torque[: part.count])
        at.t, at.x, at.before, at.torque = float(edges[-1]), x[-1], path.w[-1, -1], solved.torque[part.count - 1, -1]
        at.largest = np.maximum(at.largest, np.abs(path.x).max(axis=0))
        if event is not None and self.events is not None:
            at.stop_at(event, self.events.switch(event, begin, at.x))
        if at.linear is not None and beside is not None:
            beside = beside.first(good)
            at.linear.accept(beside)
        return part, path, power, beside

    def _solve(self, at: Progress, about: Rigid, before: Array, scale: Array) -> Solved | None:
        """The motion on the grid, by the cheapest start of the sweeps that leads to it."""
        size = float(np.abs(at.x[: len(at.x) // 2]).max())
        if size < 0.5 * at.far:
            at.begin = Start.RIGID
        for begin in list(Start)[at.begin :]:
            path = at.trail.follow(about.grid, at.x) if at.trail and begin is not Start.NEWTON else None
            solved = solve_window(self.equations, about, at.x, before, scale, self.tol, begin, path)
            if solved is not None:
                if begin > at.begin or (begin is Start.RIGID and solved.sweeps > MANY_SWEEPS):
                    at.begin, at.far = max(begin, Start.SHIFTED), size
                return solved
            if about.grid.count > FEW_STEPS:
                return None
        return None

    def _acceleration(self, at: Progress) -> Array:
        """The acceleration (n,) from which the window starts."""
        if at.before is None:
            n = len(at.x) // 2
            t = at.t + BREAK_DISTANCE * self.period
            at.before, places = solve_acceleration(self.equations, t, at.x[:n], at.x[n:])
            if at.linear is not None:
                at.linear.behind_break(places)
        return at.before


def first_refused(ratio: Array) -> int:
    """The first step (of K) whose error is not within what is allowed, or K."""
    refused = ~(ratio <= 1)
    return int(np.argmax(refused)) if refused.any() else len(ratio)


def predict(lin: Linearization, t: Array, start: Array, law: Law, tol: float) -> tuple[Array, Array]:
    """Compute the linear answer from a start, twice: on finer and on coarser steps.

        M_L y'' + D_L y' + K_L y = h_L + B_L torque

    Integrated as the nonlinear equations are, by collocation on steps that follow the motion and cross no break of it.
    Saturation and sampling are left out: they are not linear. States that outgrow all numbers are not numbers.

    Parameters
    ----------
    lin : Linearization
        With n coordinates.
    t : array, shape (N,)
        Times in s; the first is that of the start.
    start : array, shape (2n + k,)
        State [y; y'; z] at the first time, z being what the law's controller remembers.
    law : Law
        What commands the torque.
    tol : float
        Wanted difference of the two.

    Returns
    -------
    fine : array, shape (N, 2n + k)
        States of the finer run.
    coarse : array, shape (N, 2n + k)
        States of the coarser run.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.simulation import predict
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> fine, coarse = predict(lin, np.linspace(0.0, 0.1, 3), np.zeros(4), lin.law, 1e-8)
    >>> fine.shape, bool(np.abs(fine - coarse).max() < 1e-8)
    ((3, 4), True)
    """
    marks, narrow = mark_times(t[[0, -1]], lin, find_rough_times(law, lin))
    equations = LinearEquations(lin, law)

    def run(stages: int, share: float, trail: Trail | None = None) -> tuple[Array, Trail | None]:
        integrator = Collocation(equations, lin.period, stages, max(share * tol, LEAST_RUN_TOL))
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                found, _, trail = integrator.integrate(t, start, marks, narrow, trail=trail)
                return found[:, :-1], trail
        except NumericalError:
            return np.full((len(t), len(start)), np.nan), trail

    coarse, trail = run(*RUNS[0])
    fine, _ = run(*RUNS[1], trail)
    return fine, coarse


def distance(fine: Array, coarse: Array) -> float:
    """The largest difference of two resolutions, relative to the largest |x| (at least 1); infinite where one is lost."""
    apart = float(np.abs(fine - coarse).max() / max(1.0, np.abs(fine).max()))
    return apart if np.isfinite(apart) else np.inf
