"""Times that no step of an integrator passes over: breaks and narrow features of the motion, and where a law changes fast."""

from dataclasses import dataclass

import numpy as np

from flexlin.about.law import Law, VectorFunction
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.periodic.coefficients import MatrixFunction, has_nothing_narrow
from flexlin.periodic.interpolation import ChebyshevPanels, edges_of_short
from flexlin.periodic.resolved.panels import first_edges
from flexlin.periodic.resolved.resolve import resolve

INSIDE = 1e-12
"""How far beside a break of the motion what holds there is taken, in periods."""
SHORT = 64
"""Of the period: panels that are shorter begin and end with a step."""


@dataclass(frozen=True)
class Column:
    """A vector function of time (N,) -> (N, k) as a matrix of one column."""

    vector: VectorFunction

    def __call__(self, t: Array) -> Array:
        return self.vector(t)[:, :, None]


def law_times(lin: Linearization, t: Array) -> Array:
    """The times (N,) at which a law is asked: in the period, and after the end of a one-way motion as it is there."""
    return t % lin.period if lin.motion.periodic else np.minimum(t, lin.period)


def with_breaks(t: Array, lin: Linearization, rough: Array) -> Array:
    """The times t, and between them all that lie in their periods as the rough ones do in the first."""
    T = lin.period
    if not len(rough):
        return t
    rounds = T * np.arange(np.floor(t[-1] / T) + 1) if lin.motion.periodic else np.zeros(1)
    breaks = np.unique(np.add.outer(rounds, np.append(rough, T)).ravel())
    inside = breaks[(breaks > t[0]) & (breaks < t[-1])]
    near = np.abs(inside[:, None] - t[np.clip(np.searchsorted(t, inside)[:, None] + [-1, 0], 0, len(t) - 1)]).min(
        axis=1
    )
    return np.sort(np.concatenate([t, inside[near > 1e-12 * T]]))


def find_rough_times(law: Law, lin: Linearization) -> Array:
    """Times in [0, T): breaks of the motion, panels about its narrow features, and what the law adds.

    Raises: UnresolvedCoefficient, NotPeriodic as `resolve`.
    """
    own = (part for part in (law.forward, law.reference) if not (is_rigid(part) or has_nothing_narrow(part)))
    edges = [find_edges(law.gain, lin), *(find_edges(Column(part), lin) for part in own)]
    return np.unique(np.concatenate([np.array(lin.breaks, dtype=float), find_edges_of_motion(lin), *edges]))


def find_edges_of_motion(lin: Linearization) -> Array:
    """Times in [0, T) about which the linear equations change in a short time: named ones, or where these may not be all, what is found."""
    T = lin.period
    if lin.complete:
        edges = first_edges(T, np.array(lin.breaks, dtype=float), np.reshape(lin.features, (-1, 2)))
        return np.mod(edges_of_short(edges, T / SHORT), T)
    if not lin.motion.periodic:
        return find_edges(lin.A, lin)
    found = lin.periodic_system().resolved
    return np.union1d(found.breaks, np.mod(edges_of_short(found.edges, T / SHORT), T))


def is_rigid(part: VectorFunction) -> bool:
    """Whether a torque is that of the rigid motion, which changes fast where the motion says so."""
    return isinstance(getattr(part, "__self__", None), Linearization)


def find_edges(part: MatrixFunction, lin: Linearization) -> Array:
    """Times in [0, T) at which a law's part is not smooth, and about which it changes in a short time. Raises: as `resolve`."""
    T = lin.period
    if isinstance(part, ChebyshevPanels):
        return part.edges[:-1]
    if has_nothing_narrow(part):
        return np.empty(0)
    periodic = lin.motion.periodic
    breaks = sorted({*lin.breaks, *([] if periodic else [0.0])})
    found = resolve(part, T, breaks, lin.features, repeats=periodic)
    return np.union1d(found.breaks, np.mod(edges_of_short(found.edges, T / SHORT), T))
