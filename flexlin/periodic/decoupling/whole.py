"""Exponents of a system of second order from few factors of its period, where its modes grow and decay by little against each other."""

import math

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import pair_conjugates, wrap_log
from flexlin.periodic.decoupling.tame import are_in_bands, bound_factors
from flexlin.periodic.product.balancing import balance_factors
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.uncertainty import LASTING, couple_uncertainty
from flexlin.periodic.transition.choice import WAVES, choose_gauss_step
from flexlin.periodic.transition.gauss import second_order_transitions

STAGES, MORE = 8, 2
"""Gauss stages of the factors, and how many more the better ones have that measure their error."""
SAFETY = 2.0
"""Factor on the factors' error, which is measured against better ones."""
LEAST = 8
"""Segments of a period at the least."""
FIRST, MOST = 20, 128
"""Segments up to which this is tried before decoupling, which takes longer then; and after it."""
FINER = 1.5
"""How many times the segments the second try takes: the eigenvalues of the mean may be slower than those of A(t)."""


def whole_exponents(
    coefficients: ResolvedCompanion, values: Array, tol: float, most: int
) -> tuple[Array, Array, int] | None:
    """Exponents (n,), conjugates exactly, their errors (n,) and the segments taken; None where that does not serve, or misses tol.

    The factors by Gauss' rule, their Floquet vectors and what a better rule, rounding and the series change of them, as in `bound_factors`.

    Systems of first order are left to segments, of which as many are taken as tol needs and no more: their errors exaggerate less.
    Parameters: values (n,): eigenvalues of the mean of A(t); most: segments that are tried. Assumes one Fourier series.
    """
    T = coefficients.period
    segments = count_segments(values, T, coefficients.degree, tol)
    if not are_in_bands(values.real * T):
        return None
    for _ in range(2):
        if segments > most:
            return None
        found = follow_whole(coefficients, segments)
        if found is None:
            return None
        logs, errors = pair_conjugates(wrap_log(found[0]), found[1])
        if (errors <= tol * np.maximum(T, np.abs(logs))).all():
            return logs / T, errors / T, segments
        segments = math.ceil(FINER * segments)
    return None


def count_segments(values: Array, period: float, harmonics: int, tol: float) -> int:
    """Segments that reach tol on the fastest eigenvalue, and step over no harmonic."""
    rate = max(float(np.abs(values).max()), 2 * np.pi / period)
    steps = period / float(choose_gauss_step(np.array(rate), tol, STAGES))
    return max(LEAST, math.ceil(steps), math.ceil(WAVES * harmonics / STAGES))


def follow_whole(coefficients: ResolvedCompanion, segments: int) -> tuple[Array, Array] | None:
    """Logs of the multipliers (n,) and their errors (n,), in units of the states in which rows and columns are even."""
    edges = np.linspace(0.0, coefficients.period, segments + 1)
    try:
        F, better = (second_order_transitions(coefficients.sample, edges, STAGES + more) for more in (0, MORE))
    except np.linalg.LinAlgError:
        return None
    even, scale = balance_factors(F)
    to, back = (np.broadcast_to(np.diag(each), F.shape) for each in (1 / scale, scale))
    error = coefficients.mean_error(edges)
    unknown = couple_uncertainty(coefficients, (edges[1:] + edges[:-1]) / 2, to, back, error, LASTING)
    found = bound_factors(even, better * (scale / scale[:, None]), unknown * coefficients.period / segments, SAFETY)
    return None if found is None else found[:2]
