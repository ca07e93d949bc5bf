"""The periodic Schur form of a long product: one chain of bases in which every factor is upper triangular."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexlin.checks import Array
from flexlin.lapack import complex_schur
from flexlin.periodic.circle import wrap_log
from flexlin.periodic.product.sweeps import (
    CLEAN,
    SPREAD,
    TINY,
    find_clusters,
    sum_log_moduli,
    sweep_factors,
    triangularize,
)

DEAD = 1e-120
"""A mode that shrinks by this against the others in one factor counts as no smaller."""
WIDE, SLACK = 2 * SPREAD, 8.0
"""Where logs of moduli inside one cluster differ by more than WIDE, cuts may be less clean by SLACK than they were in the sweeps:
the last one goes over all factors, and what is dropped is said."""
DISORDER = 5.0
"""Logs of moduli may rise by this much from one mode to the next: they lie in one cluster then."""


@dataclass(frozen=True)
class PeriodicSchur:
    """F_k Q_k = Q_(k+1) T_k, k = 0 ... K - 1, with Q_K = Q_0 diag(turn) up to `defect`.

    Q (K + 1, n, n) unitary; T (K, n, n) complex, upper triangular; turn (n,) of modulus 1; `start` (n, n) real: the last
    orthogonal iterate, to begin a similar product from; defect: the coupling that was dropped, relative to 1.
    """

    Q: Array
    T: Array
    turn: Array
    start: Array
    defect: float

    @property
    def diagonal(self) -> Array:
        """t_k,i: the growth of mode i over factor k, (K, n)."""
        return np.diagonal(self.T, axis1=-2, axis2=-1)

    @property
    def logs(self) -> Array:
        """Logs of the eigenvalues of F_(K-1) ... F_0, (n,); imaginary parts in (-pi, pi]."""
        size = np.log(np.maximum(np.abs(self.diagonal), TINY))
        return wrap_log(sum_columns(size) + 1j * (sum_columns(np.angle(self.diagonal)) + np.angle(self.turn)))


def sum_columns(values: Array) -> Array:
    """Sum (K, n) over K by pairs, (n,): NumPy does so only along contiguous numbers, and a plain sum of K equal logs loses log2 K bits."""
    return np.asarray(np.ascontiguousarray(values.T).sum(axis=1))


def periodic_schur(factors: Array, start: Array | None = None) -> PeriodicSchur:
    """Bring a product F_(K-1) ... F_0 of real matrices into periodic Schur form.

    Cyclic QR sweeps (orthogonal iteration on the product) until only blocks of nearly equal moduli are left; inside such a
    block the complex Schur form of its own short product gives the rest.

    Parameters: factors (K, n, n), the first acts first; start (n, n): of a similar product.
    Source: Bojanczyk, Golub, Van Dooren, SPIE 1770 (1992); Watkins, SIAM Review 47 (2005).
    """
    n = factors.shape[-1]
    if len(factors) == 1:
        T, Q = complex_schur(factors[0])
        return PeriodicSchur(np.stack([Q, Q]), without_zeros(T[None]), np.ones(n, complex), np.eye(n), 0.0)
    Q, R = ordered_bases(factors, np.eye(n) if start is None else start)
    Q0 = Q[0]
    W = Q[0].T @ Q[-1]
    cuts, coupling, spread = find_clusters(W, R, CLEAN * n)
    if spread > WIDE:
        cuts, coupling, _ = find_clusters(W, R, SLACK * CLEAN * n)
    U, turn, T, dropped = np.zeros(Q.shape, complex), np.ones(n, complex), R.astype(complex), 0.0
    for a, b in pairwise(cuts):
        part = slice(a, b)
        if b - a == 1:
            U[:, a, a], turn[a] = 1.0, np.sign(W[a, a])
        else:
            U[:, part, part], turn[part], missed = triangular_bases(R[:, part, part], W[part, part])
            dropped = max(dropped, missed)
    T = np.conj(np.swapaxes(U[1:], -1, -2)) @ R @ U[:-1]
    return PeriodicSchur(Q @ U, without_zeros(np.triu(T)), turn, Q0, coupling + dropped)


def without_zeros(T: Array) -> Array:
    """Put a small number where a mode has died out to nothing beside the others, so that its log and its vectors exist."""
    i = np.arange(T.shape[-1])
    least = DEAD * np.maximum(np.abs(T).max(axis=(-2, -1)), TINY / DEAD)[..., None]
    T[..., i, i] = np.where(np.abs(T[..., i, i]) < least, least, T[..., i, i])
    return T


def ordered_bases(factors: Array, start: Array) -> tuple[Array, Array]:
    """Sweep to convergence; where a start in an invariant subspace left the moduli out of order, once more from a turned one."""
    Q, R = sweep_factors(factors, triangularize(factors, start, CLEAN)[3], keep=True)
    if np.any(np.diff(sum_log_moduli(R)) > DISORDER):
        turned = np.linalg.qr(np.random.default_rng(1931).standard_normal(start.shape))[0]
        Q, R = sweep_factors(factors, triangularize(factors, Q[0] @ turned, CLEAN)[3], keep=True)
    return Q, R


def triangular_bases(B: Array, W: Array) -> tuple[Array, Array, float]:
    """Unitary U_k with B_k U_k = U_(k+1) T_k for a block of nearly equal moduli, W U_K = U_0 diag(turn)."""
    products, _ = prefix_products(B)
    P = W @ products[-1]
    U0 = complex_schur(P)[1]
    Q, _ = np.linalg.qr(products @ U0)
    U = np.concatenate([U0[None], Q])
    T = np.conj(np.swapaxes(U[1:], -1, -2)) @ B @ U[:-1]
    size = np.abs(np.diagonal(T, axis1=-2, axis2=-1)).min(axis=-1) + TINY
    closure = np.conj(U0.T) @ W @ U[-1]
    turn = np.diagonal(closure) / np.abs(np.diagonal(closure))
    missed = max(
        float((np.abs(np.tril(T, -1)).max(axis=(-2, -1)) / size).max()), float(np.abs(closure - np.diag(turn)).max())
    )
    return U, turn, missed


def prefix_products(factors: Array) -> tuple[Array, Array]:
    """B_k ... B_0 for every k, each scaled to size 1, and the logs of the scales: a scan of log2 K batched products."""
    products, logs = factors, np.zeros(len(factors))
    step = 1
    while True:
        size = np.abs(products).max(axis=(-2, -1))
        size = np.where(size == 0, 1.0, size)
        products, logs = products / size[:, None, None], logs + np.log(size)
        if step >= len(factors):
            return products, logs
        products = np.concatenate([products[:step], products[step:] @ products[:-step]])
        logs = np.concatenate([logs[:step], logs[step:] + logs[:-step]])
        step *= 2
