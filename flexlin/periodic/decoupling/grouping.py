"""Follow the eigenvalues of A(t) along a period and put those together that come near each other."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import assign
from flexlin.periodic.precision import PARTIAL

Eigenvectors = tuple[Array, ...]
"""Eigenvalues (N, n), right vectors (N, n, n) as columns and left ones (N, n, n) as rows, at nodes."""


@dataclass(frozen=True)
class Modes:
    """Eigenvalues (N, n), right vectors (N, n, n) as columns and left ones (N, n, n) as rows, each mode followed along the nodes.

    conjugate (N, n): the mode that holds the conjugate eigenvalue (itself where that is real);
    near (n, n): pairs that must stay together: they could not be distinguished, or do not close after a period.
    """

    values: Array
    right: Array
    left: Array
    conjugate: Array
    near: Array

    def taken(self, columns: Array) -> "Modes":
        """The same modes in another order."""
        place = np.argsort(columns)
        return Modes(
            self.values[:, columns],
            self.right[:, :, columns],
            self.left[:, columns],
            place[self.conjugate[:, columns]],
            self.near[np.ix_(columns, columns)],
        )


@dataclass(frozen=True)
class Group:
    """Modes start..stop-1 of a decoupled system; `partner` is the group of their conjugates (itself: a real group)."""

    start: int
    stop: int
    partner: int

    @property
    def size(self) -> int:
        return self.stop - self.start

    @property
    def part(self) -> slice:
        return slice(self.start, self.stop)


def find_eigenvectors(A: Array) -> Eigenvectors:
    """Eigenvalues and vectors of A (N, n, n). Raises: LinAlgError where the vectors of a node depend on each other."""
    values, right = np.linalg.eig(A)
    right = right.astype(complex)
    return values.astype(complex), right, np.linalg.inv(right)


def follow_modes(found: Eigenvectors) -> Modes:
    """Eigenvalues and vectors at the nodes of a closed curve in one order: that of the first node.

    The share |w_i(t_k) v_j(t_k+1) w_j(t_k+1) v_i(t_k)| does not depend on the vectors' lengths; the best matching is taken.
    """
    values, right, left = found
    share = np.abs((left @ np.roll(right, -1, 0)) * np.swapaxes(np.roll(left, -1, 0) @ right, 1, 2))
    order, near = matched(share)
    values = np.take_along_axis(values, order, 1)
    right = np.take_along_axis(right, order[:, None, :], 2)
    left = np.take_along_axis(left, order[:, :, None], 1)
    conjugate = np.abs(values[:, :, None].conj() - values[:, None, :]).argmin(axis=2)
    return Modes(values, right, left, conjugate, near)


def matched(share: Array) -> tuple[Array, Array]:
    """The order of the modes at each node (N, n), and the pairs that are ambiguous or change places after a period (n, n)."""
    count, n = share.shape[:2]
    best = share.argmax(axis=2)
    order, near = np.empty((count + 1, n), int), np.zeros((n, n), bool)
    order[0] = np.arange(n)
    for k, step in enumerate(best):
        if len(np.unique(step)) < n:
            step = assign(-share[k])
        order[k + 1] = step[order[k]]
    now, then = order[:-1, :, None], order[1:, None, :]
    near |= (share[np.arange(count)[:, None, None], now, then] > PARTIAL).any(axis=0) & ~np.eye(n, dtype=bool)
    near[np.arange(n), order[-1]] = True
    return order[:count], near | near.T


def grouped_modes(modes: Modes, together: Array) -> tuple[Array, tuple[Group, ...]]:
    """Group modes transitively, the conjugate of every group being a group: the new order of the modes and the groups in it.

    Parameters: together (n, n): pairs that belong together besides modes.near and conjugates that change.
    """
    join = together | modes.near
    turning = (modes.conjugate != modes.conjugate[0]).any(axis=0)
    for i in np.flatnonzero(turning):
        join[i, modes.conjugate[:, i]] = True
    mate = modes.conjugate[0]
    while True:
        labels = connected(join)
        image = labels[:, None] == labels
        wider = join | image | image[np.ix_(mate, mate)]
        if (connected(wider) == labels).all():
            break
        join = wider
    columns: list[int] = []
    groups: list[Group] = []
    for label in range(labels.max() + 1):
        members = np.flatnonzero(labels == label)
        if members[0] in columns:
            continue
        index, start, size = len(groups), len(columns), len(members)
        if labels[mate[members[0]]] == label:
            groups.append(Group(start, start + size, index))
            columns += members.tolist()
        else:
            groups += [Group(start, start + size, index + 1), Group(start + size, start + 2 * size, index)]
            columns += members.tolist() + mate[members].tolist()
    return np.array(columns), tuple(groups)


def connected(join: Array) -> Array:
    """The connected components of an undirected graph (n, n): a label for each node, counted by their first members."""
    reach = join | join.T | np.eye(len(join), dtype=bool)
    while True:
        wider = reach @ reach
        if (wider == reach).all():
            return np.unique(reach.argmax(axis=1), return_inverse=True)[1]
        reach = wider


def block_mask(groups: tuple[Group, ...]) -> Array:
    """True inside the diagonal blocks (n, n)."""
    label = np.repeat(np.arange(len(groups)), [group.size for group in groups])
    return label[:, None] == label


def find_frame(modes: Modes, groups: tuple[Group, ...]) -> tuple[Array, Array]:
    """Bases T (N, n, n) of the groups' subspaces, and the real groups whose basis is complex (G,).

        T_g(t) = V_g(t) (R_g V_g(t))^-1,   R_g constant rows:  R_g T_g = 1

    T is as smooth as the subspace, periodic, and does not depend on the vectors V that span it. R_g: the left vectors L_g at the first
    node, real for a real group. Where the subspace turns away from them, L_g +- i L_g(t), t where they see least: (cos s, sin s) turns to
    (1, tan s) by the first, and to exp(-i s) (cos s, sin s) by the second.

    Source: Kato, Perturbation Theory for Linear Operators, II.4.2 (transformation functions), without their transport.
    """
    mask, V = block_mask(groups), np.empty_like(modes.right)
    V[0] = start_basis(modes, groups)
    for k in range(1, len(V)):  # carried along, so that V at one node is like V at the next
        V[k] = modes.right[k] @ ((modes.left[k] @ V[k - 1]) * mask)
    L = np.linalg.solve((modes.left @ V) * mask, modes.left)
    T, complex_basis = np.empty_like(V), np.zeros(len(groups), bool)
    for i, group in enumerate(groups):
        if group.partner < i:
            T[:, :, group.part] = T[:, :, groups[group.partner].part].conj()
            continue
        seen, R = measure_sight(L[0, group.part], V[:, :, group.part])
        if seen.min() < PARTIAL:
            turned = [R + sign * L[seen.argmin(), group.part] for sign in (1j, -1j)]
            R = max(turned, key=lambda rows: measure_sight(rows, V[:, :, group.part])[0].min())
            complex_basis[i] = group.partner == i
        own = V[:, :, group.part] @ np.linalg.inv(R @ V[:, :, group.part])
        T[:, :, group.part] = own.real if group.partner == i and not complex_basis[i] else own
    return T, complex_basis


def measure_sight(R: Array, V: Array) -> tuple[Array, Array]:
    """The least singular value of R V at each node (N,), and R."""
    return np.linalg.svd(R @ V, compute_uv=False)[:, -1], R


def start_basis(modes: Modes, groups: tuple[Group, ...]) -> Array:
    """A basis at the first node: real vectors for real groups, the eigenvectors for the others, conjugates in pairs."""
    T = modes.right[0].copy()
    for i, group in enumerate(groups):
        V = T[:, group.part]
        if group.partner == i:
            size = np.abs(V).max(axis=1, keepdims=True)
            size[size == 0] = 1
            U = np.linalg.svd(np.hstack([V.real, V.imag]) / size)[0][:, : group.size] * size
            T[:, group.part] = (V @ (modes.left[0, group.part] @ U)).real
        elif group.partner < i:
            T[:, group.part] = T[:, groups[group.partner].part].conj()
    return T
