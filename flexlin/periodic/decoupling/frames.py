"""Smooth periodic bases of the invariant subspaces of A(t), one for each group of modes."""

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.grouping import Group, Modes, block_mask

LOST = 0.3
"""A constant row that sees less than this part of a subspace at some time is not enough: it turns away."""


def find_frame(modes: Modes, groups: tuple[Group, ...], node: int = 0) -> tuple[Array, Array]:
    """Bases T (N, n, n) of the groups' subspaces, and the real groups whose basis is complex (G,).

        T_g(t) = V_g(t) (R_g V_g(t))^-1,   R_g constant rows:  R_g T_g = 1

    T is as smooth as the subspace, periodic, and does not depend on the vectors V that span it. R_g: the left vectors L_g at one node,
    real for a real group. Where the subspace turns away from them, L_g +- i L_g(t), t where they see least: (cos s, sin s) turns to
    (1, tan s) by the first, and to exp(-i s) (cos s, sin s) by the second.

    Source: Kato, Perturbation Theory for Linear Operators, II.4.2 (transformation functions), without their transport.
    """
    mask, nodes = block_mask(groups), np.arange(len(modes.values))
    V = np.empty_like(modes.right)
    V[node] = start_basis(modes, groups, node)
    for k in [*nodes[node + 1 :], *nodes[:node][::-1]]:  # carried along, so that V at one node is like V at the next
        V[k] = modes.right[k] @ ((modes.left[k] @ V[k - 1 if k > node else k + 1]) * mask)
    L = np.linalg.solve((modes.left @ V) * mask, modes.left)
    T, complex_basis = np.empty_like(V), np.zeros(len(groups), bool)
    for i, group in enumerate(groups):
        if group.partner < i:
            T[:, :, group.part] = T[:, :, groups[group.partner].part].conj()
            continue
        seen, R = measure_sight(L[node, group.part], V[:, :, group.part])
        if seen.min() < LOST:
            turned = [R + sign * L[seen.argmin(), group.part] for sign in (1j, -1j)]
            R = max(turned, key=lambda rows: measure_sight(rows, V[:, :, group.part])[0].min())
            complex_basis[i] = group.partner == i
        own = V[:, :, group.part] @ np.linalg.inv(R @ V[:, :, group.part])
        T[:, :, group.part] = own.real if group.partner == i and not complex_basis[i] else own
    return T, complex_basis


def measure_sight(R: Array, V: Array) -> tuple[Array, Array]:
    """The least singular value of R V at each node (N,), and R."""
    return np.linalg.svd(R @ V, compute_uv=False)[:, -1], R


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
