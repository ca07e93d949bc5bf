"""The linear answer on the steps of the nonlinear one, at the cost of one batched product."""

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.equations import Places
from flexlin.simulation.sweeps import Rigid
from flexlin.simulation.window import Grid, Path, between


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

    @staticmethod
    def states(grid: Grid, path: Path, t: Array) -> Array:
        """The states (N, 2n) at times t of the grid."""
        with np.errstate(over="ignore", invalid="ignore"):
            return between(grid, path, np.zeros((grid.count, grid.stages)), t)[0]
