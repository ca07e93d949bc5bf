"""Times that no step of an integrator passes over: breaks of the motion, and where a law's gain changes fast."""

import numpy as np

from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.coefficients import has_nothing_narrow
from flexlin.periodic.grid import edges_of_short
from flexlin.periodic.resolved.resolve import resolve

SHORT = 64
"""Of the period: panels of a gain that are shorter begin and end with a step."""


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
    """Breaks of the motion, and times at which the gain is not smooth or about which it changes in a short time, in [0, T)."""
    return np.union1d(np.array(lin.breaks), find_edges_of_gain(law, lin))


def find_edges_of_gain(law: Law, lin: Linearization) -> Array:
    """What the gain adds to the breaks of the motion. Raises: UnresolvedCoefficient, NotPeriodic as `resolve`."""
    gain, T = law.gain, lin.period
    if isinstance(gain, ChebyshevPanels):
        return gain.edges[:-1]
    if has_nothing_narrow(gain):
        return np.empty(0)
    periodic = lin.motion.periodic
    breaks = sorted({*lin.breaks, *([] if periodic else [0.0])})
    found = resolve(gain, T, breaks, lin.features, repeats=periodic)
    return np.union1d(found.breaks, np.mod(edges_of_short(found.edges, T / SHORT), T))
