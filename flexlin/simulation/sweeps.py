"""Newton's method on a whole window: every sweep is one mapped call and one batched product."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.equations import Equations
from flexlin.simulation.window import Grid, Path, Window

SWEEPS = 12
"""Sweeps after which a window is given up, and made shorter."""
SLOW = 0.3
"""A sweep that leaves more of the last one's change than this calls for the slopes of where it is."""
GROWN = 2.0
"""A sweep that enlarges the change so much leads nowhere."""
SHARE = 0.02
"""The share of the tolerance that the sweeps may leave over."""
STALLED = 0.1
"""The share of the tolerance at which rounding may stop the sweeps."""


@dataclass(frozen=True)
class Solved:
    """A window's motion, the power (K, s) and the torque (K, s, m) at its stages, and the matrices."""

    window: Window
    path: Path
    power: Array
    torque: Array


class Start(IntEnum):
    """Where the sweeps of a window begin, from cheap to sturdy."""

    RIGID = 0
    """On the rigid motion, with its slopes: the first sweep is the linear answer, each further one gains a factor of the deviation's size."""
    LINEAR = 1
    """The same, but exact slopes from the linear answer on."""
    REST = 2
    """At rest in the state reached, with exact slopes: for deviations that the linear answer does not meet."""


def solve_window(
    equations: Equations, grid: Grid, start: Array, scale: Array, tol: float, begin: Start, inside: float
) -> Solved | None:
    """The motion on a grid from a state `start` (2n,), or None where the sweeps do not settle.

    Slopes are kept as long as the sweeps converge with them. scale: (2n,) what tol is relative to; inside: how far before a step's end
    its last stage is taken, since a break of the motion may be there.
    """
    n = len(start) // 2
    times = np.minimum(grid.times.reshape(grid.count, -1), grid.edges[1:, None] - inside).ravel()
    at = equations.places(times)
    path, last, fresh = grid.rest(start[:n] if begin is Start.REST else np.zeros(n)), np.inf, False
    window = None if begin is Start.REST else Window(grid, *at.linear)
    for sweep in range(SWEEPS):
        stages = path.stages
        F = -at.force if sweep == 0 and window is not None else equations.residual(at, *stages)[0]
        if not np.isfinite(F).all():
            return None
        if window is None or (sweep == 1 and begin is not Start.RIGID) or fresh:
            window = Window(grid, *(equations.slopes(at, *stages) or at.linear))
        path, step = window.corrected(path, start, F)
        change = float(np.abs(step / scale).max())
        left = change / last if sweep else np.inf
        if not path.finite or (sweep > 1 and left > GROWN and change > STALLED * tol):
            return None
        if settled(change, left, tol):
            power = equations.residual(at, *path.stages)[1]
            torque = at.torque(path.stages[0], path.stages[1]).reshape(grid.count, grid.stages, -1)
            return Solved(window, path, power.reshape(grid.count, -1), torque)
        fresh = sweep > 0 and left >= SLOW
        last = change
    return None


def settled(change: float, left: float, tol: float) -> bool:
    """Whether what the sweeps still leave over does not count; `left` is the share of the last change that a sweep leaves."""
    if left >= SLOW:
        return change <= (STALLED if np.isfinite(left) else SHARE) * tol
    return change * left / (1 - left) <= SHARE * tol
