"""Right and left eigenvectors of a long product at every place between its factors."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.product.schur import PeriodicSchur

MOST = 300.0
"""Logarithm of the largest ratio of growths that differs from larger ones."""
SAME = 1e-6
"""Multipliers whose ratio is this close to 1 are left coupled: one of them has no eigenvector of its own in double precision."""


def eigenvector_chain(form: PeriodicSchur, same: float = SAME) -> tuple[Array, Array, Array]:
    """Unit upper triangular X_k with T_k X_k = X_(k+1) diag(t_k), and what is left between equal multipliers.

        X_k = T_k^-1 X_(k+1) diag(t_k) = S_k (X_(k+1) o r_k),   r_k,ji = t_k,i / t_k,j,   X_K = X_0 o (turn_i / turn_j)

    Composition of such maps is associative, so all X_k come from a scan of log2 K batched products; ratios of growth enter as
    exponentials of sums of logs, so nothing overflows where the form is ordered by modulus.

    Returns: right eigenvectors P_k = Q_k X_k (K + 1, n, n), left ones L_k = X_k^-1 Q_k^H (K + 1, n, n), the coupling N (n, n),
    strictly upper triangular, between multipliers whose ratio is 1 up to `same`.
    Raises: LinAlgError where modes that are not ordered by their growth grow too far apart on the way.
    """
    T, t = form.T, form.diagonal
    log = np.log(t)
    S = np.triu(np.linalg.inv(T / t[:, :, None]))
    with np.errstate(over="ignore", invalid="ignore"):
        S, span = suffix_maps(S, log)
    if not np.isfinite(S).all():
        raise np.linalg.LinAlgError("modes grow too far apart on the way for eigenvectors in double precision")
    total = log.sum(axis=0) + np.log(form.turn)
    X0, N = periodic_solution(S[0], total, same)
    XK = np.triu(X0 * np.exp(np.log(form.turn)[None, :] - np.log(form.turn)[:, None]))
    X = np.concatenate([S @ np.triu(XK * ratio(span)), XK[None]])
    return form.Q @ X, np.linalg.solve(X, np.conj(np.swapaxes(form.Q, -1, -2))), N


def ratio(log: Array) -> Array:
    """exp(log_i - log_j), (..., n, n), its upper triangle; entries below stay zero.

    Modes that grow by more than exp(MOST) against each other are ordered, unless nothing couples them: then a finite number will do.
    """
    size = log.real[..., None, :] - log.real[..., :, None]
    upper = np.triu(np.ones(size.shape[-2:], bool))
    size = np.exp(np.where(upper, np.minimum(size, MOST), -np.inf))
    phase = np.exp(1j * log.imag)
    return np.asarray(size * phase[..., None, :] * phase.conj()[..., :, None])


def suffix_maps(S: Array, log: Array) -> tuple[Array, Array]:
    """Compose the maps k, k + 1, ..., K - 1 for every k: S_(a:c) = S_(a:b) (S_(b:c) o r_(a:b)), logs add."""
    step = 1
    while step < len(S):
        joined = S[:-step] @ (S[step:] * ratio(log[:-step]))
        S = np.concatenate([joined, S[-step:]])
        log = np.concatenate([log[:-step] + log[step:], log[-step:]])
        step *= 2
    return S, log


def periodic_solution(S: Array, total: Array, close: float) -> tuple[Array, Array]:
    """X = S (X o r) for the whole period, X unit upper triangular; entries between equal multipliers stay zero."""
    n = len(S)
    r = ratio(total)
    upper = np.triu(np.ones((n, n), bool), 1)
    same = upper & (np.abs(1 - r) < close)
    free = (upper & ~same).T  # [i, j]: row j of column i is an unknown
    system = np.where(free[:, :, None], np.eye(n) - np.where(free[:, None, :], S * r.T[:, None, :], 0), np.eye(n))
    right = np.where(free, S.T, 0)
    X = np.linalg.solve(system, right[:, :, None])[:, :, 0].T + np.eye(n)
    N = np.where(same, S @ np.triu(X * r) - X, 0)
    return X, N


def separate_triangular(T: Array) -> tuple[Array, Array]:
    """X unit upper triangular with T X = X diag(t) + N: eigenvectors of an upper triangular matrix, N left between equal eigenvalues.

    (t_j - t_i) X_ji + sum_(j < l < i) T_jl X_li = -T_ji      for j < i
    """
    n, t = len(T), np.diagonal(T)
    upper = np.triu(np.ones((n, n), bool), 1)
    same = upper & (np.abs(t[:, None] - t) <= SAME * np.maximum(np.abs(t[:, None]), np.abs(t)))
    free = (upper & ~same).T
    rows, columns = free[:, :, None], free[:, None, :]
    system = np.where(rows, np.where(columns, T - t[:, None, None] * np.eye(n), 0), np.eye(n))
    X = np.linalg.solve(system, np.where(free, -T.T, 0)[:, :, None])[:, :, 0].T + np.eye(n)
    return X, np.where(same, T @ X - X * t, 0)
