"""A system with a controller that has states of its own, as one linear periodic system."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficients import MatrixFunction
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
class Widened:
    """[0, K_z] as a function of time: what of a gain acts on the controller's states alone."""

    gain: MatrixFunction
    first: int

    def __call__(self, t: Array) -> Array:
        out = np.array(self.gain(t))
        out[:, :, : self.first] = 0.0
        return out


def extend_system(system: PeriodicSystem, rates: Array) -> PeriodicSystem:
    """The system with the states z of a controller behind its own, its loop still open.

    [x; z]' = [[A, 0], [rates]] [x; z] + [B; 0] u,   rates (k, n + k)
    """
    B = None if system.B is None else ExtendedInput(system.B, len(rates))
    A = ExtendedState(system.A, rates)
    return PeriodicSystem(A, system.period, B, system.breaks, None, system.features, system.complete)
