"""The linear answer to a disturbance that begins at any phase of the period: all phases together."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.sampled.hold import STAGES, sections
from flexlin.periodic.system import PeriodicSystem

INSIDE = 8
"""Times at which a push is looked at while it lasts."""


@dataclass(frozen=True, eq=False)
class LinearAnswer:
    """Deviations from the steady motion: phases (P,), t (S,) in s after the beginning, states (P, S, 2n)."""

    phases: Array
    t: Array
    states: Array

    def times(self, period: float) -> Array:
        """The times of the motion, (P, S)."""
        return self.phases[:, None] * period + self.t


def answer_linearly(
    loop: PeriodicSystem,
    enters: MatrixFunction,
    start: Array,
    size: float,
    duration: float,
    count: int,
    phases: int,
    points: int,
    tol: float,
) -> LinearAnswer:
    """Follow x' = A x + enters(t) u from x = start, u = size for `duration` s (for ever when 0), over `count` steps of T / points.

    Parameters: phases divides points.
    """
    T, n = loop.period, loop.n
    driven = PeriodicSystem(loop.A, T, enters, loop.breaks, loop.second_order, loop.features, loop.complete)
    begin = np.arange(phases) / phases
    z = np.empty((phases, n + 1))
    z[:, :n], z[:, n] = start, size
    kept, t = [z[:, :n].copy()], [0.0]
    if duration:
        edges = (begin[:, None] * T + duration * np.arange(INSIDE) / INSIDE).ravel()
        inside = sections(driven, edges, edges + duration / INSIDE, tol, STAGES).reshape(phases, INSIDE, n + 1, n + 1)
        for k in range(INSIDE):
            z = np.einsum("pij,pj->pi", inside[:, k], z)
            kept.append(z[:, :n].copy())
            t.append(duration * (k + 1) / INSIDE)
        z[:, n] = 0.0
    grid = duration + T * np.arange(points) / points
    steps, place = sections(driven, grid, grid + T / points, tol, STAGES), np.arange(phases) * (points // phases)
    for k in range(count):
        z = np.einsum("pij,pj->pi", steps[(place + k) % points], z)
        kept.append(z[:, :n].copy())
        t.append(duration + T * (k + 1) / points)
    return LinearAnswer(begin, np.array(t), np.stack(kept, axis=1))
