"""What torque noise does to a loop in the long run: the root mean square of its deviations over the period."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.answers.disturbed.stated import Directions, Disturbance
from flexlin.checks import SAMPLES, Array
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.quadratic.riccati import periodic_lyapunov
from flexlin.periodic.related import Backward, OfPlant, dual_system
from flexlin.periodic.system import PeriodicSystem
from flexlin.summary import represent


@dataclass(frozen=True, eq=False)
class NoiseAnswer:
    """Root mean squares in the long run, beside the steady motion.

    Attributes
    ----------
    words : str
        The noise as it was stated.
    t : array, shape (N,)
        Times of a period, in s.
    states : array, shape (N, 2n)
        Of [y; y'], in their units.
    tip : array, shape (N,)
        Of the tip across the last link, in m; not numbers without a tip.
    error : float
        Relative error of the covariance.
    """

    words: str
    t: Array
    states: Array
    tip: Array
    error: float

    __repr__ = represent


@dataclass(frozen=True, eq=False)
class Spread:
    """B S B' as a function of time."""

    B: MatrixFunction
    intensity: float

    complete: ClassVar[bool] = True

    def __call__(self, t: Array) -> Array:
        B = self.B(t)
        return self.intensity * B @ np.swapaxes(B, 1, 2)


def answer_noise(lin: Linearization, stated: Disturbance, loop: PeriodicSystem, tol: float = 1e-8) -> NoiseAnswer:
    """Find the periodic covariance of a loop under white torque noise at every input.

        P' = A P + P A' + S B B',   P(t + T) = P(t),   S = size^2 / (2 bandwidth)

    Assumes a bandwidth beyond what the loop follows. The loop must be stable; its equation is the dual one with time reversed.
    Raises: NotStable when it is not.
    """
    T = lin.period
    W = Spread(OfPlant(lin.input_matrix, 2 * lin.n, loop.n), stated.size**2 / (2 * stated.time))
    solution = periodic_lyapunov(dual_system(loop), Backward(W, T), tol)
    t = np.linspace(0.0, T, SAMPLES + 1)
    P = solution.X(np.mod(-t, T))[:, : 2 * lin.n, : 2 * lin.n]
    tip = np.full(len(t), np.nan)
    if lin.arm.near.points is not None:
        across = Directions(lin)
        rows = np.stack([across.seen(t, np.tile(row, (len(t), 1))) for row in np.eye(2 * lin.n)], axis=1)
        tip = np.sqrt(np.maximum(np.einsum("ti,tij,tj->t", rows, P, rows), 0.0))
    states = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    return NoiseAnswer(stated.words, t, states, tip, solution.error)
