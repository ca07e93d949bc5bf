"""A system with a controller that has states of its own, as one linear periodic system."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficients import MatrixFunction
from flexlin.periodic.related import with_matrices
from flexlin.periodic.system import PeriodicSystem


@dataclass(frozen=True, eq=False)
class ExtendedState:
    """[[A, 0], [rates]] as a function of time, for rates (k, n + k)."""

    A: MatrixFunction
    rates: Array

    def __call__(self, t: Array) -> Array:
        k, size = self.rates.shape
        out = np.zeros((len(t), size, size))
        out[:, : size - k, : size - k] = self.A(t)
        out[:, size - k :] = self.rates
        return out


@dataclass(frozen=True, eq=False)
class ExtendedInput:
    """[B; 0] as a function of time."""

    B: MatrixFunction
    rows: int

    def __call__(self, t: Array) -> Array:
        upper = self.B(t)
        return np.concatenate([upper, np.zeros((len(t), self.rows, upper.shape[2]))], axis=1)


@dataclass(frozen=True, eq=False)
class OfPlant:
    """What acts on the n states of a plant, (N, n or more, ...), in a system of `states` states of which they are the first.

    A function of the motion: it is narrow where the plant's coefficients are.
    """

    function: MatrixFunction
    n: int
    states: int

    complete: ClassVar[bool] = True

    def __call__(self, t: Array) -> Array:
        values = self.function(t)
        out = np.zeros((len(t), self.states, *values.shape[2:]))
        out[:, : self.n] = values[:, : self.n]
        return out


def extend_system(system: PeriodicSystem, rates: Array) -> PeriodicSystem:
    """The system with the states z of a controller behind its own, its loop still open.

    [x; z]' = [[A, 0], [rates]] [x; z] + [B; 0] u,   rates (k, n + k)
    """
    B = None if system.B is None else ExtendedInput(system.B, len(rates))
    A = ExtendedState(system.A, rates)
    return with_matrices(system, A, B)
