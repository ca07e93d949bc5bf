"""The noise of a computed function, measured from differences on closely spaced times."""

from math import factorial

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.resolved.sampling import GOLDEN, Sampler

RARE = 1e-11
"""Noise that some times have and others have not: roundings of a computed function, which jump where it pivots in another order."""
POINTS, ORDERS = 16, (5, 6)
SPACING = 0.9713e-5
"""Of the panel: a function that the panel nearly resolves changes by less than 1e-16 of itself in a fifth difference."""

LOUD, FAINT = 1e-3, 1e-13
"""Noise above LOUD of an entry's size is none, but a motion that was not followed, unless it is below FAINT of the largest entry."""


def noise_level(sample: Sampler, begin: Array, end: Array, spots: int = 2) -> Array:
    """Estimate the standard deviation of the noise of A on panels (P,), for each entry: (P, E).

        sigma_k^2 = (k!)^2 / (2 k)!  mean (Delta^k f)^2

    The larger of two orders k, on the quieter of `spots` places of the panel, so that a jump at one of them is not taken for noise. What
    is FAINT at all of them is rounding, which comes and goes: there the louder place counts.
    Source: Moré and Wild, Estimating computational noise, SIAM J. Sci. Comput. 33 (2011), Eq. (2.4).
    """
    where = 0.1 + 0.8 * np.mod(GOLDEN * (1 + np.arange(spots) + 0.37 * np.arange(len(begin))[:, None]), 1.0)
    width = (end - begin)[:, None]
    t = (begin[:, None] + where * width)[:, :, None] + SPACING * width[:, :, None] * np.arange(POINTS)
    size = np.where(sample.scale > 0, sample.scale, 1.0)
    values = sample(t.ravel()).reshape(len(begin), spots, POINTS, -1) / size
    levels = []
    for k in ORDERS:
        gamma = factorial(k) ** 2 / factorial(2 * k)
        levels.append(np.sqrt(gamma * (np.diff(values, k, axis=2) ** 2).mean(axis=2)))
    faint = FAINT * sample.scale.max()
    quiet, loud = (extreme(np.maximum(*levels), axis=1) * size for extreme in (np.min, np.max))
    level = np.where(loud <= np.maximum(RARE * sample.scale, faint), loud, quiet)
    return np.asarray(np.where(level <= np.maximum(LOUD * sample.scale, faint), level, 0.0))
