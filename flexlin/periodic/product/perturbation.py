"""Eigenvectors of one triangular matrix, and what pairs and blocks of eigenvalues do to each other beyond first order."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.precision import CUBE, MINOR, TINY

COHERENT = 0.25
"""The part of the rounding errors that may add up with one sign."""


def separate_triangular(T: Array) -> tuple[Array, Array]:
    """X unit upper triangular with T X = X diag(t) + N: eigenvectors of an upper triangular matrix, N left between equal eigenvalues.

    (t_j - t_i) X_ji + sum_(j < l < i) T_jl X_li = -T_ji      for j < i
    """
    n, t = len(T), np.diagonal(T)
    upper = np.triu(np.ones((n, n), bool), 1)
    same = upper & (np.abs(t[:, None] - t) <= CUBE * np.maximum(np.abs(t[:, None]), np.abs(t)))
    free = (upper & ~same).T
    rows, columns = free[:, :, None], free[:, None, :]
    system = np.where(rows, np.where(columns, T - t[:, None, None] * np.eye(n), 0), np.eye(n))
    X = np.linalg.solve(system, np.where(free, -T.T, 0)[:, :, None])[:, :, 0].T + np.eye(n)
    return X, np.where(same, T @ X - X * t, 0)


def bound_pairs(coupling: Array, own: Array, gap: Array, shared: Array) -> Array:
    """What pairs of eigenvalues do to each other beyond first order, (n,).

    Parameters: coupling (n, n): of the perturbation in the eigenvectors' coordinates; own (n,): first-order motions, which may
    close gaps; gap (n, n): distances of the eigenvalues; shared (n, n): couplings left between equal ones.
    """
    gap = np.maximum(gap - own[:, None] - own, 0.0)
    size = pair_size(coupling)
    pairs = np.where(size > MINOR * gap, 2 * size, size**2 / np.maximum(gap, size + TINY))  # as in motion.c
    return pairs.sum(axis=1) + bound_shared(coupling, np.abs(shared))


def pair_size(coupling: Array) -> Array:
    """sqrt(A_ij A_ji) of each pair (n, n), zero on the diagonal."""
    product = coupling * coupling.T
    np.fill_diagonal(product, 0.0)
    return np.asarray(np.sqrt(product))


def bound_shared(coupling: Array, shared: Array) -> Array:
    """Elsner's bound (|N| + |E|)^(1 - 1/m) |E|^(1/m) for each block of m multipliers that N couples; zero elsewhere."""
    bound = np.zeros(len(shared))
    linked = shared + shared.T > 0
    for members in {
        tuple(np.flatnonzero(row | own).tolist())
        for row, own in zip(linked, np.eye(len(shared), dtype=bool), strict=True)
    }:
        if len(members) > 1:
            block, m = np.ix_(members, members), len(members)
            E, N = np.linalg.norm(coupling[block]), np.linalg.norm(shared[block])
            bound[list(members)] = np.maximum(bound[list(members)], (N + E) ** (1 - 1 / m) * E ** (1 / m))
    return bound
