"""Newton's method on a whole window: every sweep is one mapped call and one batched product."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.equations import Equations, Matrices, Places
from flexlin.simulation.window import Grid, Path, Window

SWEEPS = 14
"""Sweeps after which a window is given up, and made shorter."""
SLOW = 0.4
"""A sweep that leaves more of the last one's change than this calls for slopes of where it is, and a second one for exact ones."""
GROWN = 2.0
"""A sweep that enlarges the change so much leads nowhere."""
SHARE = 0.02
"""The share of the tolerance that the sweeps may leave over."""
STALLED = 0.1
"""The share of the tolerance at which rounding may stop the sweeps."""


@dataclass(frozen=True)
class Solved:
    """A window's motion, the power (K, s) and the torque (K, s, m) at its stages, the matrices, and how many sweeps it took.

    at, rigid: the equations of the rigid motion at the stages, and their matrices.
    """

    window: Window
    path: Path
    power: Array
    torque: Array
    sweeps: int
    at: Places
    rigid: Window


class Start(IntEnum):
    """Where the sweeps of a window begin and with which slopes, from cheap to sturdy."""

    RIGID = 0
    """On the rigid motion, with its slopes: the first sweep is the linear answer, others gain a factor of the deviation's size."""
    SHIFTED = 1
    """At rest in the state reached; the slopes of the rigid motion, all shifted by what they differ in that state."""
    NEWTON = 2
    """On with the rates of the state reached, with slopes new in each sweep, exact ones once that is slow."""


def solve_window(
    equations: Equations, grid: Grid, start: Array, before: Array, scale: Array, tol: float, begin: Start, inside: float
) -> Solved | None:
    """The motion on a grid from a state `start` (2n,) with acceleration `before` (n,), or None where the sweeps do not settle.

    scale: (2n,) what tol is relative to; inside: how far before a step's end its last stage is taken, since a break may be there.
    """
    n = len(before)
    times = np.minimum(grid.times, grid.edges[1:, None] - inside).ravel()
    at = equations.places(times)
    rigid = begin is Start.RIGID
    last, slow, newton = np.inf, 0, begin is Start.NEWTON
    path = grid.coasting(start) if newton else grid.rest(np.zeros(n) if rigid else start[:n])
    window = first = Window(
        grid, *(at.linear if rigid else shifted(equations, at, grid.edges[0] + inside, start, before))
    )
    for sweep in range(SWEEPS):
        F = -at.force if rigid and sweep == 0 else equations.residual(at, *path.stages)[0]
        if not np.isfinite(F).all():
            return None
        if slow + newton > 1:
            window = Window(grid, *(equations.slopes(at, *path.stages) or at.linear), often=False)
        elif slow or newton:
            window = Window(grid, *shifted_by_steps(equations, at, path), often=False)
        path, step = window.corrected(path, start, F)
        change = float(np.abs(step / scale).max())
        left = change / last if last > 0 else 0.0
        if not path.finite:
            return None
        if settled(change, left if sweep else np.inf, tol):
            power = equations.residual(at, *path.stages)[1].reshape(grid.count, -1)
            torque = at.torque(path.stages[0], path.stages[1]).reshape(grid.count, grid.stages, -1)
            linear = first if rigid else Window(grid, *at.linear, often=False)
            return Solved(window, path, power, torque, sweep + 1, at, linear)
        if sweep > 1 and left > GROWN:
            return None
        last, slow = change, slow + 1 if sweep > 0 and left >= SLOW else slow * newton
    return None


def shifted(equations: Equations, at: Places, t: float, start: Array, before: Array) -> Matrices:
    """The slopes of the rigid motion at all stages, shifted by what those of one state differ from them."""
    n, here = len(before), equations.places(np.array([t]))
    exact = equations.slopes(here, start[None, :n], start[None, n:], before[None])
    if exact is None:
        return at.linear
    M, D, K = (rigid + (there - one) for rigid, there, one in zip(at.linear, exact, here.linear, strict=True))
    return M, D, K


def shifted_by_steps(equations: Equations, at: Places, path: Path) -> Matrices:
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


def settled(change: float, left: float, tol: float) -> bool:
    """Whether what the sweeps still leave over does not count; `left` is the share of the last change that a sweep leaves."""
    if left >= SLOW:
        return change <= (STALLED if np.isfinite(left) else SHARE) * tol
    return change * left / (1 - left) <= SHARE * tol
