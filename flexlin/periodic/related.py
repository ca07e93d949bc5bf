"""Systems made from another over the same period: they are rough and change fast where it does."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.coefficients import MatrixFunction, has_nothing_narrow
from flexlin.periodic.resolved.matrix import ResolvedCompanion, ResolvedMatrix
from flexlin.periodic.resolved.search import first_edges
from flexlin.periodic.system import PeriodicSystem


def with_matrices(
    system: PeriodicSystem,
    A: MatrixFunction,
    B: MatrixFunction | None = None,
    breaks: Sequence[float] = (),
    others: Sequence[MatrixFunction] = (),
) -> PeriodicSystem:
    """x' = A(t) x + B(t) u with matrices that are made of those of a system, and perhaps of others with breaks of their own."""
    corners, complete = (*system.breaks, *breaks), system.complete and all(map(has_nothing_narrow, others))
    return PeriodicSystem(A, system.period, B, corners, features=system.features, complete=complete)


def dual_system(system: PeriodicSystem, C: MatrixFunction | None = None) -> PeriodicSystem:
    """x' = A(-t)' x + C(-t)' u, whose cost is the covariance of the system's states, as a function of -t.

    Source: Bittanti, Colaneri, Periodic Systems (2009), ch. 7.
    """
    T = system.period
    breaks = [(T - t) % T for t in system.breaks]
    features = [((T - t) % T, width) for t, width in system.features]
    B = None if C is None else Backward(C, T)
    complete = system.complete and (B is None or B.complete)
    return PeriodicSystem(Backward(system.A, T), T, B, breaks, features=features, complete=complete)


def corners_of(system: PeriodicSystem) -> tuple[float, ...]:
    """Times in [0, T) between which what is made of the system's coefficients is smooth and changes slowly, as far as they are named."""
    if not system.features:
        return system.breaks
    edges = first_edges(system.period, np.array(system.breaks), np.array(system.features))
    return tuple(edges[:-1].tolist())


def edges_between(*series: ResolvedMatrix | ResolvedCompanion) -> list[float]:
    """Times in [0, T) between which all series are smooth: edges of their panels, or breaks."""
    places = [one.breaks if one.panels == 1 else one.edges[:-1] for one in series]
    return np.unique(np.concatenate(places)).astype(float).tolist()


@dataclass(frozen=True, eq=False)
class Backward:
    """t -> coefficient(-t)', taken inside one period; as complete as the coefficient."""

    coefficient: MatrixFunction
    period: float

    def __call__(self, t: Array) -> Array:
        return np.swapaxes(self.coefficient(np.mod(-t, self.period)), 1, 2)

    @property
    def complete(self) -> bool:
        return has_nothing_narrow(self.coefficient)


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
    B = None if system.B is None else OfPlant(system.B, system.n, system.n + len(rates))
    return with_matrices(system, ExtendedState(system.A, rates), B)
