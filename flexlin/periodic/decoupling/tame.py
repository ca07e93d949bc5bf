"""Exponents of a small group whose modes do not grow against each other without bounds: from its Floquet vectors along the period."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import measure_distances, wrap_log
from flexlin.periodic.decoupling.group_factors import COARSE, FINE, FINER, METHOD, fit_group
from flexlin.periodic.product.balancing import multiply_scaled
from flexlin.periodic.product.perturbation import CANCELLED, EPS, FACTOR_ROUNDING, bound_pairs

STEP, FASTEST = 3.0, 600.0
"""The largest product of a segment's length and the norm of the generator, and of the period and it."""
TOGETHER = 8
"""Segments come in so many: compiled code makes them together."""
GROWTH, WAVES = 5e-11, 5.0
"""The error of a log as measured: this times the rate times the period, times the sixth power of the rate times a part's length; the rate
is the norm of the generator, and the basic frequency so many times."""
AIM, LARGEST, TRIES = 0.1, 0.3, 3
"""The part of what is allowed that parts aim at, and beyond which they are made finer, until so many were tried."""
INDEPENDENT = 1e3
"""Floquet vectors with a larger condition number belong to multipliers that nearly coincide: they are not served here."""
LARGEST_GROWTH = 1e9
"""Modes are followed in two bands, those that grow most forward and the others backward. Of one that grows against another of its band by
more over a period, the product would hold no vector."""


def tame_exponents(values: Array, period: float, unknown: Array, allowed: float) -> tuple[Array, Array] | None:
    """Logs of the multipliers of w' = values(t) w and their errors (p,); None where its Floquet vectors are not well conditioned.

        F_k R_k = R_(k+1) G_k,   log mu_i = sum_k log g_k,i + log c_ii,   C = R_0^-1 R_K

        d log mu_i = sum_k (R_(k+1)^-1 dF_k R_k)_ii / g_k,i

    R_0: the eigenvectors of the whole product, G_k diagonal so that all columns have length 1; the product holds a weak mode's vector to
    rounding, but not its multiplier, and what the others add to it on the way shows in C. dF_k: what Magnus series on longer parts change,
    rounding, and what is not known over the length of a segment. Pairs i, j add their second order.

    Parameters: values (N, p, p), real, at the nodes k T / N; unknown (p, p): bound on what is not known of them, in 1/s; allowed: error of
    a log.
    """
    norm = float(measure_size(values).max())
    if not norm * period < FASTEST:
        return None
    segments = TOGETHER * max(1, int(np.ceil(period * norm / STEP / TOGETHER)))
    turns = period * norm + 2 * np.pi * WAVES
    series = fit_group(values, period, unknown)
    wanted, found = turns * (GROWTH * turns / (AIM * allowed)) ** (1 / 6), None
    for _ in range(TRIES):
        parts = max(1, int(np.ceil(wanted / (FINE * segments))))
        F, coarse = (series.factor(segments, count * parts) for count in (FINE, COARSE))
        found = bound_factors(F, coarse, period / segments * series.unknown, METHOD * FINER, FINE * parts)
        share = 0.0 if found is None else float(found[2].max()) / allowed
        if share < LARGEST:
            break
        wanted = FINE * parts * segments * (share / AIM) ** (1 / 6)
    return None if found is None else (wrap_log(found[0]), found[1])


def bound_factors(
    F: Array, other: Array, unknown: Array, share: float, roundings: int = 1
) -> tuple[Array, Array, Array] | None:
    """Logs of the multipliers of a product of factors (K, p, p), their errors (p,), and the method's part in these; as `tame_exponents`.

    None where it does not serve.

    Parameters: other: the same factors, more or less accurate, and which share of the difference counts; unknown (p, p) or (K, p, p):
    bound on what is not known of a factor's generator, times the factor's length; roundings: products behind a factor.
    """
    p = F.shape[-1]
    try:
        multipliers, R, G = follow_vectors(F)
        L = np.linalg.inv(R)
    except np.linalg.LinAlgError:
        return None
    if not (measure_size(R) * measure_size(L)).max() < INDEPENDENT * p:
        return None
    closure, lengths = L[0] @ R[-1], np.log(G)
    if not are_in_bands(lengths.sum(axis=0)):
        return None
    logs = with_conjugates(lengths.sum(axis=0) + np.log(np.diagonal(closure)), multipliers)
    step = L[1:] @ (other - F) @ R[:-1] / G[:, :, None]
    rounding = roundings * FACTOR_ROUNDING * EPS * measure_size(F)[:, None, None]
    known = (np.abs(L[1:]) @ (unknown + rounding) @ np.abs(R[:-1]) / G[:, :, None]).sum(axis=0)
    size = np.abs(step).sum(axis=0)
    method = share * np.maximum(np.abs(np.diagonal(step.sum(axis=0))), CANCELLED * np.diagonal(size))
    own = method + np.diagonal(known) + FACTOR_ROUNDING * EPS * np.diagonal(np.abs(L[0]) @ np.abs(R[-1]))
    gap = measure_distances(logs, logs)
    pairs = bound_pairs(size + known + np.abs(closure), own, gap, np.zeros((p, p)))
    return logs, own + pairs + 4 * EPS * np.abs(logs), method


def are_in_bands(growth: Array) -> bool:
    """Whether modes stand in two bands of their growth over a period (n,), as a logarithm, each narrow enough to be followed."""
    low, high, width = growth.min(), growth.max(), np.log(LARGEST_GROWTH)
    return bool(((growth - low < width) | (high - growth < width)).all())


def follow_vectors(F: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues (p,) of the product of factors (K, p, p), its eigenvectors along it, of length 1 (K + 1, p, p), and their growth (K, p).

    Those of modes that the product holds are followed forward; those that are too weak for it are the strong ones of the inverse, and
    followed backward. Of their eigenvalues the angles alone are right. Raises: LinAlgError where they are not found.
    """
    multipliers, start = np.linalg.eig(multiply_scaled(F)[0])
    top = np.abs(multipliers) * LARGEST_GROWTH > np.abs(multipliers).max()
    R, G = np.empty((len(F) + 1, *start.shape), complex), np.empty(F.shape[:2])
    if not top.all():
        inverse = np.linalg.inv(F)
        values, vectors = np.linalg.eig(multiply_scaled(inverse[::-1])[0])
        order = np.argsort(-np.abs(values), kind="stable")[: np.count_nonzero(~top)]
        multipliers = np.concatenate([multipliers[top], values[order]])
        if values[order].imag.sum() != 0:
            raise np.linalg.LinAlgError("a pair would be torn apart")
        start, back = np.concatenate([start[:, top], vectors[:, order].conj()], axis=1), vectors[:, order].conj()
        R[-1, :, -back.shape[1] :] = back
        for k in range(len(F) - 1, -1, -1):
            back = inverse[k] @ back
            back /= np.sqrt((np.abs(back) ** 2).sum(axis=0))
            R[k, :, -back.shape[1] :] = back
        start[:, -back.shape[1] :] = back
    strong = np.count_nonzero(top)
    R[0] = start
    for k, factor in enumerate(F):
        more = factor @ R[k]
        G[k] = np.sqrt((np.abs(more) ** 2).sum(axis=0))
        R[k + 1, :, :strong] = (more / G[k])[:, :strong]
    return multipliers, R, G


def with_conjugates(logs: Array, multipliers: Array) -> Array:
    """Logs (p,) that are conjugate, or those of real numbers, exactly where the multipliers are; pairs stand side by side."""
    real, below = multipliers.imag == 0, np.flatnonzero(multipliers.imag < 0)
    logs = np.where(real, logs.real + np.pi * 1j * (multipliers.real < 0), logs)
    logs[below] = logs[below - 1].conj()
    return logs


def measure_size(matrices: Array) -> Array:
    """Frobenius' norms (...) of matrices (..., p, p)."""
    return np.sqrt((np.abs(matrices) ** 2).sum(axis=(-2, -1)))
