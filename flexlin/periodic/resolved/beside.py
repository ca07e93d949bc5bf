"""What a representation misses within 1e-11 of the period of the places where a coefficient is not smooth."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.chebyshev import ChebyshevPanels
from flexlin.periodic.resolved.sampling import Sampler

DOUBLINGS = 20
"""Distances from a place at which it is looked at: from its last bit to beyond 1e-11 T, where check points begin."""
LEAST = np.finfo(float).eps / 8
"""The least distance, of the period."""


def miss_beside(sample: Sampler, series: ChebyshevPanels, places: Array, looked_at: Array) -> Array:
    """Bound the integral of |A - series| close to each place (B,), for each entry: (B, E); zero beside those not looked at.

        |A(t+) - A(t-)| d_0 / 2   +   sum over both sides and k of   (d_k - d_(k-1)) max(|A - series|(t +- d_k), |A - series|(t +- d_(k-1)))

    with d_0 the last bit of t. A jump that is off by d costs its height times d; a kink half of d^2 times the jump of its slope.
    """
    missed = np.zeros((len(places), series.coefficients[0, 0].size))
    which = np.isin(places, looked_at)
    edges = places[which]
    if not len(edges):
        return missed
    T = sample.period
    away = np.maximum(np.spacing(edges), LEAST * T)[:, None] * 2.0 ** np.arange(DOUBLINGS)
    t = np.mod(edges[:, None, None] + away[:, None] * np.array([[-1.0], [1.0]]), T)
    apart = np.abs(sample(t.ravel()) - series(t.ravel()).reshape(t.size, -1)).reshape(*t.shape, -1)
    nearer = np.concatenate([apart[:, :, :1], apart[:, :, :-1]], axis=2)
    width = np.diff(away, axis=1, prepend=0.0)
    jump = np.abs(series(edges) - series(edges, left=True)).reshape(len(edges), -1)
    missed[which] = away[:, :1] / 2 * jump + np.einsum("bk,bske->be", width, np.maximum(apart, nearer))
    return missed
