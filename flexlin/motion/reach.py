"""How far a path lies out of an arm's reach."""

import numpy as np

from flexlin.checks import Array
from flexlin.errors import MotionError
from flexlin.motion.tip_equations import TipEquations
from flexlin.series.tracking import find_lowest

PHASES = 64
FAR = 1e-6
"""Relative to the arm: a distance below this is none."""
STIFF = 1e3
"""Weight of the loops' closure, which must hold, against the tip's distance."""


def refuse_unreachable(equations: TipEquations, start: Array, period: float, at: float | None = None) -> None:
    """Raise with time and distance where the tip cannot reach the path, as far as a search from `start` finds; `at`: phase where it ends.

    The distance is that of the led components of the position; a path whose orientation alone cannot be reached is not this.
    """
    begun, y = 0.0 if at is None else at, start[: equations.coordinates]
    phases, distances, nearest = begun + np.arange(PHASES + 1) / PHASES, list[float](), list[Array]()
    for phase in phases:
        distance, y = find_distance(equations, start, y, float(phase))
        distances.append(distance)
        nearest.append(y)
    size = max(float(np.abs(equations.task(start, 0.0)[1].full()[: equations.tips]).max()), 1e-300)
    k = int(np.argmax(distances))
    if distances[k] <= FAR * size:
        return
    where, least = find_lowest(
        lambda phase: -find_distance(equations, start, nearest[k], phase)[0],
        phases[k] - 1 / PHASES,
        phases[k] + 1 / PHASES,
    )
    raise MotionError(
        "the path leaves the arm's reach",
        got=f"out of reach from t = {begun * period:.6g} s on, by {-least:.4g} m at t = {where % 1.0 * period:.6g} s",
        todo="move the path nearer, or give another posture",
    )


def find_distance(equations: TipEquations, start: Array, y: Array, phase: float) -> tuple[float, Array]:
    """The least distance of the tip from the path's point near coordinates y, and the coordinates there."""
    from scipy.optimize import least_squares

    n, rest = equations.coordinates, start[equations.coordinates :]
    weights = np.ones(equations.c.numel())
    weights[equations.tips :] = STIFF if equations.joints < n else 1.0

    def miss(y: Array) -> Array:
        return np.asarray(weights * equations.task(np.append(y, rest), phase % 1.0)[0].full()[:, 0])

    def slope(y: Array) -> Array:
        return np.asarray(weights[:, None] * equations.task(np.append(y, rest), phase % 1.0)[1].full())

    best = least_squares(miss, y, slope, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return float(np.linalg.norm(best.fun[: equations.tips])), best.x
