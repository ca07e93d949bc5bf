"""Smooth periodic bases of the invariant subspaces of A(t), one for each group of modes."""

import warnings

import numpy as np
from numpy.polynomial.legendre import leggauss

from flexlin.checks import Array
from flexlin.lapack import complex_schur
from flexlin.periodic.decoupling.grouping import Group, Modes, block_mask
from flexlin.periodic.transition.exponential import exponentiate

NORMAL = 100.0
"""Eigenvectors of a smaller condition number than this give a logarithm without loss."""
REAL = 1e-6
"""A real group's basis may have imaginary parts of this size against its columns: rounding of ill-conditioned eigenvectors."""
NEAR, ROOTS, NODES = 0.25, 60, 8
"""How near to I a root is taken, in at most so many steps; nodes of the quadrature that is then exact to 1e-16."""


def periodic_frame(modes: Modes, groups: tuple[Group, ...]) -> tuple[Array, Array] | None:
    """Bases T (N, n, n) of the groups' subspaces, carried along by projection, and the groups that turn over (G,).

        T(t_k+1) = V_g W_g(t_k+1) T(t_k),   after a period T(0) H;   T(t) := T(t) exp(-(t / T) log H)

    Discrete parallel transport follows any rotation of a subspace, and the exponential closes the circle. A real group whose H
    has negative eigenvalues turns over: then log(-H) closes it with the factor exp(-i pi t / T).

    Returns: None where no logarithm closes a real group.
    Source: Kato, Perturbation Theory for Linear Operators, II.4.2 (transformation functions).
    """
    mask = block_mask(groups)
    count = len(modes.values)
    T = np.empty_like(modes.right)
    T[0] = now = start_basis(modes, groups, 0)
    for k in [*range(1, count), 0]:
        now = modes.right[k] @ ((modes.left[k] @ now) * mask)
        if k:
            T[k] = now
    H = np.linalg.solve(T[0], now)
    L, turning = np.zeros_like(H), np.zeros(len(groups), bool)
    for i, group in enumerate(groups):
        closing = closed(H[group.part, group.part], group.partner == i)
        if closing is None:
            return None
        L[group.part, group.part], turning[i] = closing
    return made_real(T @ turn_back(L, groups, count), groups, turning), turning


def turn_back(L: Array, groups: tuple[Group, ...], count: int) -> Array:
    """exp(-(k / N) L) for k = 0 ... N - 1, (N, n, n), block by block."""
    steps = np.zeros((count, *L.shape), complex)
    part = -np.arange(count) / count
    for group in groups:
        block = L[group.part, group.part]
        exponents = part[:, None, None] * block
        turned = np.exp(exponents) if group.size == 1 else exponentiate(exponents)
        steps[:, group.part, group.part] = turned
    return steps


def open_frame(modes: Modes, groups: tuple[Group, ...]) -> Array:
    """Bases T (N, n, n) over an open interval: those of its middle projected on the subspaces, T_g(t) = V_g W_g(t) T_g(middle)."""
    start = start_basis(modes, groups, len(modes.values) // 2)
    return made_real(modes.right @ ((modes.left @ start) * block_mask(groups)), groups, np.zeros(len(groups), bool))


def start_basis(modes: Modes, groups: tuple[Group, ...], node: int) -> Array:
    """A basis at one node: real vectors for real groups, the eigenvectors for the others, conjugates in pairs."""
    T = modes.right[node].copy()
    for i, group in enumerate(groups):
        V = T[:, group.part]
        if group.partner == i:
            size = np.abs(V).max(axis=1, keepdims=True)
            size[size == 0] = 1
            U = np.linalg.svd(np.hstack([V.real, V.imag]) / size)[0][:, : group.size] * size
            T[:, group.part] = (V @ (modes.left[node, group.part] @ U)).real
        elif group.partner < i:
            T[:, group.part] = T[:, groups[group.partner].part].conj()
    return T


def closed(H: Array, real: bool) -> tuple[Array, bool] | None:
    """The logarithm that takes the turn H out of a basis, and whether the basis turns over; None where none does."""
    if len(H) == 1:
        return close_single(complex(H[0, 0]), real)
    for sign in (1, -1):
        L = logarithm(sign * H.real if real else H)
        if L is None:
            return None
        if not real:
            return L, False
        if np.abs(L.imag).max() <= 1e-8 * max(1.0, np.abs(L).max()):
            return (L.real + 0j, False) if sign == 1 else (L.real + 1j * np.pi * np.eye(len(H)), True)
    return None


def close_single(H: complex, real: bool) -> tuple[Array, bool] | None:
    """The same for a single mode."""
    turns = real and H.real < 0
    value = -H.real if turns else H.real if real else H
    if not 0 < abs(value) < np.inf:
        return None
    return np.array([[np.log(complex(value)) + 1j * np.pi * turns]]), turns


def logarithm(H: Array) -> Array | None:
    """The principal logarithm, None where the matrix is singular to working precision; by eigenvectors where these are nearly normal."""
    if not np.linalg.cond(H) < 1 / np.finfo(float).eps:
        return None
    values, vectors = np.linalg.eig(H)
    if np.linalg.cond(vectors) < NORMAL:
        return np.asarray(np.linalg.solve(vectors.T, (vectors * np.log(values.astype(complex))).T).T)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an inaccurate logarithm shows in the coupling between the nodes
        return logarithm_by_roots(H)


def logarithm_by_roots(H: Array) -> Array | None:
    """The principal logarithm by inverse scaling and squaring; None where no root comes near to I.

        log H = 2^k log(I + X),   I + X = H^(1 / 2^k),   log(I + X) = int_0^1 X (I + s X)^-1 ds

    Source: Dieci, Morini, Papini, SIAM J. Matrix Anal. Appl. 17 (1996), 570; Gauss' rule makes it the diagonal Pade approximant.
    """
    eye, halvings, (root, Z) = np.eye(len(H)), 0, complex_schur(H)
    while not np.linalg.norm(root - eye, 1) < NEAR:
        root, halvings = triangular_root(root), halvings + 1
        if halvings > ROOTS or not np.isfinite(root).all():
            return None
    nodes, weights = leggauss(NODES)
    X, s = root - eye, (nodes[:, None, None] + 1) / 2
    return np.asarray(
        Z @ (2**halvings * np.einsum("k,kij->ij", weights / 2, np.linalg.solve(eye + s * X, X))) @ Z.conj().T
    )


def triangular_root(T: Array) -> Array:
    """The principal root R of an upper triangular complex matrix, column by column; not finite where there is none.

        (R_jj I + R_<j) r_j = t_j

    Source: Björck, Hammarling, A Schur method for the square root of a matrix, Linear Algebra Appl. 52/53 (1983), 127.
    """
    R = np.diag(np.sqrt(np.diagonal(T)))
    for j in range(1, len(T)):
        shifted = R[:j, :j] + R[j, j] * np.eye(j)
        R[:j, j] = np.linalg.solve(shifted, T[:j, j]) if np.diagonal(shifted).all() else np.nan
    return R


def made_real(T: Array, groups: tuple[Group, ...], turning: Array) -> Array:
    """Take rounding out of the imaginary parts of real groups, and make conjugate groups conjugate exactly."""
    turn = np.exp(-1j * np.pi * np.arange(len(T)) / len(T))[:, None, None]
    for i, group in enumerate(groups):
        if group.partner == i:
            phase = turn if turning[i] else 1.0
            T[:, :, group.part] = (T[:, :, group.part] / phase).real * phase
        elif group.partner > i:
            T[:, :, groups[group.partner].part] = T[:, :, group.part].conj()
    return T
