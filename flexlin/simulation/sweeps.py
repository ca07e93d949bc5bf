"""Newton's method on a whole window: sweeps are made in compiled code, with other slopes where they are slow."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.simulation.equations import LinearEquations, Matrices, Places
from flexlin.simulation.window import Found, Grid, Path, Sweeps, Window


@dataclass(frozen=True)
class Solved:
    """A window's motion, the power (K, s) and the torque (K, s, m) at its stages, the matrices, and how many sweeps it took."""

    window: Window
    path: Path
    power: Array
    torque: Array
    sweeps: int


@dataclass(frozen=True)
class Rigid:
    """The equations about the rigid motion at the stages of a grid."""

    grid: Grid
    at: Places

    @classmethod
    def of(cls, equations: LinearEquations, grid: Grid, inside: float) -> "Rigid":
        """All that depends on the times alone; a step's last stage is taken `inside` before its end, where a break may be."""
        times = np.minimum(grid.times, grid.edges[1:, None] - inside).ravel()
        return cls(grid, equations.places(times))

    @lazy
    def window(self) -> Window:
        """The linear equations, factored."""
        return Window(self.grid, *self.at.linear)

    def first(self, count: int) -> "Rigid":
        """The same on the first steps, the window cut."""
        if count == self.grid.count:
            return self
        grid = self.grid.first(count)
        part = Rigid(grid, self.at.some(slice(count * grid.stages)))
        vars(part)["window"] = self.window.first(grid)
        return part


class Start(IntEnum):
    """Where the sweeps of a window begin and with which slopes, from cheap to sturdy."""

    RIGID = 0
    """On the rigid motion, with its slopes: the first sweep is the linear answer, others gain a factor of the deviation's size."""
    SHIFTED = 1
    """At rest in the state reached; the slopes of the rigid motion, shifted by what they differ there."""
    NEWTON = 2
    """On with the rates and accelerations of the state reached, with exact slopes in each sweep."""


def solve_window(
    equations: LinearEquations,
    about: Rigid,
    start: Array,
    before: Array,
    scale: Array,
    tol: float,
    begin: Start,
    path: Path | None = None,
) -> Solved | None:
    """The motion on a grid from a state `start` (2n,) with acceleration `before` (n,), or None where the sweeps do not settle.

    scale: (2n,) what tol is relative to; path: where the sweeps begin, if that is known better.
    """
    n, grid, at = len(before), about.grid, about.at
    rigid, newton = begin is Start.RIGID, begin is Start.NEWTON
    resting, renewed, slow = rigid and path is None, newton, 0
    path = path or (grid.coasting(start, before) if newton else grid.rest(np.zeros(n) if rigid else start[:n]))
    first = about.window if begin is not Start.SHIFTED else Window(grid, *shifted(equations, at, path))
    F, ready = np.empty((len(at.t), n)), equations.ready(at)
    sweeps = Sweeps(first, path, start, scale, np.ascontiguousarray(at.gain), np.ascontiguousarray(at.offset), F)
    while True:
        if renewed:
            exact = equations.slopes(at, *path.stages) if newton or slow > 1 else None
            sweeps.window = Window(grid, *(exact or shifted(equations, at, path)))
        known = resting and not sweeps.made
        if known:
            F[:] = -at.force
        elif ready is None:
            F[:], known = equations.residual(at, *path.stages), True
        found = sweeps.go_on(ready, tol, known, newton) if sweeps.window.sound else Found.LOST
        if found is Found.LOST:
            return None
        if found is Found.SETTLED:
            shape, power = (grid.count, grid.stages), equations.power(at, *path.stages)
            return Solved(sweeps.window, path, power.reshape(shape), sweeps.torque.reshape(*shape, -1), sweeps.made)
        slow += found is Found.SLOW
        renewed = newton or found is Found.SLOW


def shifted(equations: LinearEquations, at: Places, path: Path) -> Matrices:
    """The slopes of the rigid motion, those of each step shifted by what they differ from exact ones in its middle."""
    stages = path.w.shape[1]
    middle = np.arange(stages // 2, len(at.t), stages)
    here = at.some(middle)
    exact = equations.slopes(here, *(part[middle] for part in path.stages))
    if exact is None:
        return at.linear
    M, D, K = (
        rigid + np.repeat(there - one, stages, axis=0)
        for rigid, there, one in zip(at.linear, exact, here.linear, strict=True)
    )
    return M, D, K
