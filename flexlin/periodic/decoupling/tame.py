"""Exponents of a small group whose modes grow and decay by little against each other: from the product of its factors itself."""

from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import measure_distances, wrap_log
from flexlin.periodic.decoupling.waves import interpolated
from flexlin.periodic.product.balancing import GROUP_CONDITION
from flexlin.periodic.product.perturbation import CANCELLED, EPS, FACTOR_ROUNDING, bound_pairs
from flexlin.periodic.transition.gauss import collocate, gauss, place_nodes

STAGES, MORE = 8, 2
"""Gauss stages of the factors, and how many more the better ones have that measure their error."""
STEP, FASTEST = 3.0, 600.0
"""The largest product of a segment's length and the norm of the generator, and of the period and it: a segment then errs by 1e-14."""
LEAST = 8
"""Segments of a period at the least."""
SAFETY = 2.0
"""Factor on the factors' error, which is measured against better ones."""
INDEPENDENT = 1e3
"""Eigenvectors of the product with a larger condition number belong to multipliers that nearly coincide: they are not served here."""


def tame_exponents(values: Array, period: float, unknown: Array) -> tuple[Array, Array] | None:
    """Logs of the multipliers of w' = values(t) w and their errors (p,); None where the product is not well conditioned.

        d log mu_i = sum_k (R_(k+1)^-1 dF_k R_k)_ii,   R_k = F_(k-1) ... F_0 R,   R the eigenvectors of the whole product

    dF_k: what factors with more stages change, rounding, and `unknown` over the length of a segment. Pairs i, j add their second order.

    Parameters: values (N, p, p), real, at the nodes k T / N; unknown (p, p): bound on what is not known of them, in 1/s.
    """
    p, rate = values.shape[-1], float(measure_size(values).max())
    if not rate * period < FASTEST:
        return None
    segments = max(LEAST, int(np.ceil(period * rate / STEP)))
    h = period / segments
    try:
        F, better = (factor_tame(values, h, segments, STAGES + more) for more in (0, MORE))
        products = np.empty((segments + 1, p, p))
        products[0] = np.eye(p)
        for k, factor in enumerate(F):
            products[k + 1] = factor @ products[k]
        back = np.linalg.inv(products)
        multipliers, vectors = np.linalg.eig(products[-1])
        rows = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    if not (measure_size(products) * measure_size(back)).max() < GROUP_CONDITION:
        return None
    if not measure_size(vectors) * measure_size(rows) < INDEPENDENT:
        return None
    logs = np.log(multipliers.astype(complex))
    R, L = products[:-1] @ vectors, rows @ back[1:]
    step = L @ (better - F) @ R
    rounding = FACTOR_ROUNDING * EPS * measure_size(F)[:, None, None]
    known = (np.abs(L) @ (h * unknown + rounding) @ np.abs(R)).sum(axis=0)
    size = np.abs(step).sum(axis=0)
    own = SAFETY * np.maximum(np.abs(np.diagonal(step.sum(axis=0))), CANCELLED * np.diagonal(size)) + np.diagonal(known)
    gap = measure_distances(logs, logs)
    errors = own + bound_pairs(size + known, own, gap, np.zeros((p, p))) + 4 * EPS * np.abs(logs)
    return wrap_log(logs), errors


def measure_size(matrices: Array) -> Array:
    """Frobenius' norms (...) of matrices (..., p, p)."""
    return np.sqrt((np.abs(matrices) ** 2).sum(axis=(-2, -1)))


def factor_tame(values: Array, h: float, segments: int, stages: int) -> Array:
    """Transition matrices (K, p, p) over equal segments of length h by Gauss collocation."""
    p, rule = values.shape[-1], gauss(stages)
    samples = (interpolate_nodes(len(values), segments, stages) @ values.reshape(len(values), -1)).reshape(
        segments, stages, p, p
    )
    return collocate(samples, np.full(segments, h), rule)


@lru_cache(maxsize=32)
def interpolate_nodes(count: int, segments: int, stages: int) -> Array:
    """The matrix from values at equidistant nodes of a period to those at the stages of all segments."""
    return interpolated(np.eye(count), 1.0, place_nodes(np.linspace(0, 1, segments + 1), gauss(stages).c).ravel())
