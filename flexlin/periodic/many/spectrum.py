"""Eigenvalues of long products for many values at once, taken from the factors."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.many.algebra import add_identity, factor_qr, multiply
from flexlin.periodic.product.eigenvalues import TINY, find_log_eigenvalues

SPREAD = 9.2
"""Logs of moduli inside one multiplied-out cluster may differ by this much: log 1e4, so four digits are lost."""
MAX_SWEEPS = 8
LARGE = 1e150
"""Factors with larger entries would overflow where a length is taken; such a value is unsound."""


def group_batch(factors: Array, spread: float, accuracy: float) -> Array:
    """Multiply neighbours F_(k+1) F_k while a group separates modes by less than hides accuracy behind rounding.

    The weakest mode does not count: its modulus follows from the determinant.
    Parameters: factors (K, n, n, V); spread: of the logs of the moduli over the whole product, the weakest left out.
    """
    largest = np.log(accuracy / (10 * np.finfo(float).eps))
    while len(factors) % 2 == 0 and 2 * spread <= largest * len(factors):
        factors = np.einsum("kijv,kjlv->kilv", factors[1::2], factors[0::2])
    return factors


@np.errstate(over="ignore", invalid="ignore")
def find_product_logs(
    factors: Array, log_det: Array, accuracy: float, Q: Array | None = None
) -> tuple[Array, Array, Array]:
    """Logs of the eigenvalues of F_(K-1) ... F_0 for every value, by cyclic QR sweeps.

        F_k Q_k = Q_(k+1) R_k,   W = Q_0' Q_K,   product ~ W R_(K-1) ... R_0

    Sweeps repeat from Q_0 := Q_K until, for every value, clean cuts of W leave clusters of narrow spread. The weakest eigenvalue,
    which the rounding of the others hides, is what they leave of the determinant.

    Parameters: factors (K, n, n, V), the first acts first; log_det (V,): log of the product's positive determinant;
    accuracy: of a log; couplings as small are cut; Q (n, n, V): an orthogonal Q_0 from a coarser resolution.
    Returns: logs (n, V), imaginary parts modulo 2 pi; sound (V,): whether the clusters are narrow and nothing overflowed; the last Q_0.
    Source: Watkins, Product eigenvalue problems, SIAM Review 47 (2005).
    """
    if Q is None:
        Q = np.zeros(factors.shape[1:])
        add_identity(Q, 1.0)
    for _ in range(MAX_SWEEPS):
        end, R = sweep_batch(factors, Q)
        W = np.einsum("jiv,jkv->ikv", Q, end)
        cut, sizes = find_cuts(W, accuracy), sum_diagonals(R)
        sizes[-1] = log_det - sizes[:-1].sum(axis=0)
        sound = measure_widest(cut, sizes) <= SPREAD
        if sound.all():
            break
        Q = end
    logs = solve_clusters(W, R, cut)
    sound &= np.isfinite(logs).all(axis=0) & (np.abs(factors) < LARGE).all(axis=(0, 1, 2))
    logs[-1] = np.where(cut[-2], log_det - logs[:-1].sum(axis=0), logs[-1])
    return logs, sound, Q


def sweep_batch(factors: Array, Q: Array) -> tuple[Array, Array]:
    """One sweep F_k Q_k = Q_(k+1) R_k; returns Q_K and all R_k."""
    R = np.empty_like(factors)
    for k, factor in enumerate(factors):
        Q, R[k] = factor_qr(multiply(factor, Q))
    return Q, R


def find_cuts(W: Array, accuracy: float) -> Array:
    """Where W is decoupled, (n + 1, V): cut i stands before row i; the ends are always cut.

    What is cut off moves a log by about its size, as an error of that size in one factor would.
    """
    n = len(W)
    cut = np.ones((n + 1, W.shape[-1]), dtype=bool)
    for i in range(1, n):
        cut[i] = np.abs(W[i:, :i]).max(axis=(0, 1)) <= accuracy
    return cut


def sum_diagonals(R: Array) -> Array:
    """Sum of log |r_ii| over the factors, (n, V)."""
    diagonal = np.abs(np.einsum("kiiv->kiv", R))
    return np.log(np.maximum(diagonal, TINY)).sum(axis=0)


def measure_widest(cut: Array, sizes: Array) -> Array:
    """The widest spread of the log moduli inside a cluster, (V,)."""
    result = np.zeros(sizes.shape[1])
    high, low = sizes[0].copy(), sizes[0].copy()
    for i in range(1, len(sizes)):
        high = np.where(cut[i], sizes[i], np.maximum(high, sizes[i]))
        low = np.where(cut[i], sizes[i], np.minimum(low, sizes[i]))
        result = np.maximum(result, high - low)
    return result


def solve_clusters(W: Array, R: Array, cut: Array) -> Array:
    """Logs of the eigenvalues of W R_(K-1) ... R_0: each diagonal block alone, all values with the same block together."""
    n = len(W)
    logs = np.empty((n, W.shape[-1]), dtype=complex)
    for start in range(n):
        for stop in range(start + 1, n + 1):
            chosen = cut[start] & cut[stop] & ~cut[start + 1 : stop].any(axis=0)
            block, which = slice(start, stop), slice(None) if chosen.all() else chosen
            if chosen.any():
                logs[block, which] = solve_block(W[block, block, which], R[:, block, block, which])
    return logs


def solve_block(W: Array, R: Array) -> Array:
    """Logs of the eigenvalues of W R_(K-1) ... R_0 for blocks whose moduli lie close together.

    They do not over- nor underflow; entries above the diagonals may, where too few segments step over fast modes: NaN there.
    """
    if len(W) == 1:
        negative = np.signbit(np.concatenate([R[:, 0, 0], W[0]])).sum(axis=0) % 2
        return sum_diagonals(R) + 1j * np.pi * negative
    log_size = np.log(np.maximum(np.abs(np.einsum("kiiv->kiv", R)), TINY)).mean(axis=1)
    P = multiply(W, multiply_chain(R / np.exp(log_size)[:, None, None]))
    finite = np.isfinite(P).all(axis=(0, 1))
    logs = np.moveaxis(find_log_eigenvalues(np.moveaxis(np.where(finite, P, 1.0), -1, 0)), 0, -1)
    return np.where(finite, logs, np.nan) + log_size.sum(axis=0)


def multiply_chain(factors: Array) -> Array:
    """F_(K-1) ... F_0 for factors (K, n, n, V)."""
    while len(factors) > 1:
        even = len(factors) - len(factors) % 2
        pairs = np.einsum("kijv,kjlv->kilv", factors[1:even:2], factors[0:even:2])
        factors = np.concatenate([pairs, factors[even:]]) if even < len(factors) else pairs
    return factors[0]
