"""Eigenvalues of a long product of matrices, taken from the factors: 1e-1300 and 1e+1300 come out beside each other."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg.lapack import dgeqrf, dorgqr

from flexlin.checks import Array
from flexlin.periodic.circle import match_logs, wrap_angle
from flexlin.periodic.product.balancing import balance_factors, group_factors, multiply_pairs, multiply_scaled

CLEAN = 1e-14
"""A cut between two groups of moduli is clean when the coupling below it is this small (times n)."""
SPREAD = 4.6
"""The logs of moduli inside one multiplied-out cluster may differ by this much: log 100, so two digits are lost."""
MIN_SWEEPS, MAX_SWEEPS, MAX_WORK = 12, 400, 8_000_000
"""Bounds on the sweeps, and on n^2 times the number of QR factorizations in all of them together."""
FULL_SWEEPS, GRADED = 2, 200.0
"""Sweeps over all factors before triangular ones are multiplied together, and the range of logs of a product's diagonal."""
EPS, TINY = float(np.finfo(float).eps), float(np.finfo(float).tiny)
NOISE, PROBES = 14.0, 2
"""Random perturbations of the factors that measure the conditioning: roundings per factor, and how many trials."""


@dataclass(frozen=True)
class ProductSpectrum:
    """Logarithms of the eigenvalues of F_(K-1) ... F_0.

    logs (n,) complex by falling real part, imaginary parts in (-pi, pi]; `rounding` (n,): how far they move when the factors
    are perturbed as rounding perturbs them; `groups`: factors left after grouping; `sweeps`: QR sweeps made;
    basis (n, n): of the nested invariant subspaces, a start for the sweeps of a similar product.
    """

    logs: Array
    rounding: Array
    groups: int
    sweeps: int
    basis: Array | None = None


def product_spectrum(
    factors: Array, probes: int = PROBES, turns: float = 0.0, basis: Array | None = None
) -> ProductSpectrum:
    """Logs of the eigenvalues of the product F_(K-1) ... F_0 without forming it, and what rounding does to them.

    The conditioning is measured, not bounded: the grouped factors are perturbed at random, `probes` times by NOISE roundings
    per factor, and the largest motion of each eigenvalue is kept. So multiple and defective eigenvalues need no special case.

    Parameters: factors (K, n, n) real, the first acts first; probes: 0 where the rounding is not asked;
    turns: norm of the logarithm of the whole product where that is large (its rounding is in the factors);
    basis: of a similar product, to start the sweeps from.
    Source: Watkins, Product eigenvalue problems, SIAM Review 47 (2005); Bojanczyk, Golub, Van Dooren (1992) for the periodic Schur form.
    """
    even, scale = balance_factors(factors)
    groups = group_factors(even)
    level = EPS * (NOISE * np.sqrt(len(factors) / len(groups)) + turns / len(groups))
    size = np.abs(groups).max(axis=(-2, -1), keepdims=True)
    noisy = groups + level * size * draw_noise((probes, *groups.shape))
    if len(groups) == 1:
        logs, *moved = find_log_eigenvalues(np.concatenate([groups, noisy[:, 0]]))
        sweeps, backward, basis = 0, 0.0, None
    else:
        start = np.eye(len(scale)) if basis is None else np.linalg.qr(basis / scale[:, None])[0]
        logs, backward, sweeps, Q = find_cyclic_logs(groups, start)
        basis = scale[:, None] * Q
        moved = [find_cyclic_logs(probe, Q, 10 * level)[0] for probe in noisy]
    rounding = backward + 4 * EPS * np.abs(logs)
    if moved:
        rounding += np.max([match_logs(logs, other)[1] for other in moved], axis=0)
    order = np.argsort(-logs.real, kind="stable")
    return ProductSpectrum(logs[order], rounding[order], len(groups), sweeps, basis)


@lru_cache(maxsize=64)
def draw_noise(shape: tuple[int, ...]) -> Array:
    """Standard normal numbers, the same in every run."""
    return np.random.default_rng(20190610).standard_normal(shape)


def find_cyclic_logs(factors: Array, Q: Array, clean: float = CLEAN) -> tuple[Array, float, int, Array]:
    """Logs of the eigenvalues of the product by cyclic QR sweeps that start from Q.

        F_k Q_k = Q_(k+1) R_k,   k = 0 ... K - 1;   W = Q_0' Q_K;   product ~ W R_(K-1) ... R_0

    Sweeps (orthogonal iteration on the product) repeat from Q_0 := Q_K until W is block diagonal with blocks whose
    eigenvalues have moduli close together; these blocks alone are multiplied out, rescaled at each step.

    Returns: logs, the backward error of the cuts and of the blocks, the number of sweeps, and the last Q_0.
    """
    W, R, sweeps, Q = triangularize(factors, Q, clean)
    cuts, coupling, spread = find_clusters(W, R, clean * len(W))
    blocks = [solve_cluster(W, R, start, stop) for start, stop in pairwise(cuts)]
    loss = float(np.exp(min(max(0.0, spread - SPREAD), 36.0)))
    return np.concatenate(blocks), coupling + EPS * (loss - 1), sweeps, Q


def triangularize(factors: Array, Q: Array, clean: float) -> tuple[Array, Array, int, Array]:
    """Sweep until every cluster is narrow; the width that is accepted rises slowly so that equal gaps end too.

    After FULL_SWEEPS the rows of R are graded: then triangular factors may be multiplied together without loss, and the
    sweeps go on over W and these few products.
    """
    n, base, limit = factors.shape[-1], np.eye(len(Q)), MAX_SWEEPS
    for sweep in range(1, MAX_SWEEPS + 1):
        end, R = sweep_factors(factors, Q)
        W = Q.T @ end
        if find_clusters(W, R, clean * n)[2] <= SPREAD + sweep / 20 or sweep == limit:
            break
        if sweep == FULL_SWEEPS:
            base, Q, factors = Q, np.eye(n), np.concatenate([group_triangular(R), W[None]])
            end = W
            limit = max(MIN_SWEEPS, min(MAX_SWEEPS, MAX_WORK // (n * n * len(factors))))
        Q = end
    return W, R, sweep, base @ Q


def group_triangular(R: Array) -> Array:
    """Multiply neighbouring upper triangular factors while the logs of their diagonals stay below GRADED."""
    size = np.log(np.maximum(np.abs(np.diagonal(R, axis1=-2, axis2=-1)), TINY))
    while len(R) > 1:
        size = size[:-1:2] + size[1::2] if len(size) % 2 == 0 else np.concatenate([size[:-1:2] + size[1::2], size[-1:]])
        if np.abs(size).max() > GRADED:
            break
        R = multiply_pairs(R)
    return R


def sweep_factors(factors: Array, Q: Array) -> tuple[Array, Array]:
    """One sweep F_k Q_k = Q_(k+1) R_k; returns Q_K and all R_k (K, n, n)."""
    R = np.empty_like(factors)
    for k, factor in enumerate(factors):
        packed, tau, _, _ = dgeqrf(factor @ Q, overwrite_a=1)
        R[k] = packed
        Q = dorgqr(packed, tau, overwrite_a=1)[0]
    return Q, np.triu(R)


def find_clusters(W: Array, R: Array, clean: float) -> tuple[list[int], float, float]:
    """Cut where W is decoupled: the bounds of the clusters, the coupling that is dropped, the widest spread of log moduli."""
    below = np.maximum.accumulate(np.maximum.accumulate(np.abs(W)[::-1])[::-1], axis=1)
    coupling = [0.0, *np.diagonal(below, offset=-1).tolist(), 0.0]
    cuts = [i for i, value in enumerate(coupling) if value <= clean]
    size = sum_log_moduli(R).tolist()
    spread = max(max(size[a:b]) - min(size[a:b]) for a, b in pairwise(cuts))
    return cuts, max(coupling[i] for i in cuts), spread


def sum_log_moduli(R: Array) -> Array:
    """Sum of log |r_ii| over the factors; a zero counts as the smallest number."""
    diagonal = np.abs(np.diagonal(R, axis1=-2, axis2=-1))
    return np.log(np.maximum(diagonal, TINY)).sum(axis=0)


def solve_cluster(W: Array, R: Array, start: int, stop: int) -> Array:
    """Logs of the eigenvalues of one diagonal block of W R_(K-1) ... R_0."""
    part = slice(start, stop)
    if stop - start == 1:
        negative = (np.signbit(R[:, start, start]).sum() + np.signbit(W[start, start])) % 2
        return np.array([sum_log_moduli(R[:, part, part])[0] + 1j * np.pi * negative])
    P, log_scale = multiply_scaled(R[:, part, part])
    return find_log_eigenvalues(W[part, part] @ P) + log_scale


def find_log_eigenvalues(P: Array) -> Array:
    """Logs of the eigenvalues of matrices (..., n, n), imaginary parts in (-pi, pi]."""
    values = np.linalg.eigvals(P)
    size = np.maximum(np.abs(values), TINY)
    return np.log(size) + 1j * wrap_angle(np.angle(values))
