"""Frames of groups of modes: eigenvalues followed along a period, grouped, and bases of the groups' subspaces."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.circle import assign
from flexlin.periodic.interpolation import FourierSeries, harmonics, weigh_harmonics
from flexlin.periodic.product import complex_schur
from flexlin.precision import PARTIAL, ROOT_EPS

SLOW_PART = 0.8
"""Harmonics of the coupling below this part of the gap shrink from round to round."""


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


@dataclass(frozen=True)
class Group:
    """Modes start..stop-1 of a decoupled system; `partner` is the group of their conjugates (itself: a real group).

    turning: a real group whose basis is complex, since it turns within a period.
    """

    start: int
    stop: int
    partner: int
    turning: bool = False

    @property
    def size(self) -> int:
        return self.stop - self.start

    @property
    def part(self) -> slice:
        return slice(self.start, self.stop)


def follow_modes(A: Array) -> Modes:
    """Eigenvalues and vectors of A (N, n, n) at the nodes of a closed curve in one order: that of the first node.

    The share |w_i(t_k) v_j(t_k+1) w_j(t_k+1) v_i(t_k)| does not depend on the vectors' lengths; the best matching is taken.
    Raises: LinAlgError where the vectors of a node depend on each other.
    """
    values, right = (part.astype(complex) for part in np.linalg.eig(A))
    left = np.linalg.inv(right)
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
    order, near = np.empty((count + 1, n), int), np.zeros((n, n), bool)
    order[0] = np.arange(n)
    for k in range(count):
        order[k + 1] = assign(-share[k])[order[k]]
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


def find_frame(right: Array, left: Array, groups: tuple[Group, ...]) -> tuple[Array, tuple[Group, ...]]:
    """Bases T (N, n, n) of the groups' subspaces from the modes' right and left vectors, and the groups, of which some are turning.

        T_g(t) = V_g(t) (R_g V_g(t))^-1,   R_g constant rows:  R_g T_g = 1

    T is as smooth as the subspace, periodic, and does not depend on the vectors V that span it. R_g: the left vectors L_g at the first
    node, real for a real group. Where the subspace turns away from them, L_g +- i L_g(t), t where they see least: (cos s, sin s) turns to
    (1, tan s) by the first, and to exp(-i s) (cos s, sin s) by the second.

    Source: Kato, Perturbation Theory for Linear Operators, II.4.2 (transformation functions), without their transport.
    """
    mask, V = block_mask(groups), np.empty_like(right)
    V[0] = start_basis(right[0], left[0], groups)
    for k in range(1, len(V)):  # carried along, so that V at one node is like V at the next
        V[k] = right[k] @ ((left[k] @ V[k - 1]) * mask)
    L = np.linalg.solve((left @ V) * mask, left)
    T, found = np.empty_like(V), list(groups)
    for i, group in enumerate(groups):
        if group.partner < i:
            T[:, :, group.part] = T[:, :, groups[group.partner].part].conj()
            continue
        R, U, real = L[0, group.part], V[:, :, group.part], group.partner == i
        seen = measure_sight(R, U)
        if seen.min() < PARTIAL:
            turned = [R + sign * L[seen.argmin(), group.part] for sign in (1j, -1j)]
            R = max(turned, key=lambda rows: measure_sight(rows, U).min())
            found[i] = replace(group, turning=real)
        own = U @ np.linalg.inv(R @ U)
        T[:, :, group.part] = own.real if real and not found[i].turning else own
    return T, tuple(found)


def measure_sight(R: Array, V: Array) -> Array:
    """The least singular value of R V at each node (N,)."""
    return np.linalg.svd(R @ V, compute_uv=False)[:, -1]


def start_basis(right: Array, left: Array, groups: tuple[Group, ...]) -> Array:
    """A basis at the first node: real vectors for real groups, the eigenvectors for the others, conjugates in pairs."""
    T = right.copy()
    for i, group in enumerate(groups):
        V = T[:, group.part]
        if group.partner == i:
            size = np.abs(V).max(axis=1, keepdims=True)
            size[size == 0] = 1
            U = np.linalg.svd(np.hstack([V.real, V.imag]) / size)[0][:, : group.size] * size
            T[:, group.part] = (V @ (left[group.part] @ U)).real
        elif group.partner < i:
            T[:, group.part] = T[:, groups[group.partner].part].conj()
    return T


def are_kept(count: int) -> Array:
    """Which harmonics the filter keeps, the lower third (N,): the others hold the rounding that differentiation amplifies."""
    return np.abs(harmonics(count)) <= count / 3


def smooth(values: Array) -> Array:
    """Leave out the harmonics that are not kept."""
    return weigh_harmonics(values, are_kept(len(values)))


def interleaved(nodes: Array, between: Array) -> Array:
    """Values at nodes and half-way between them as one series of twice the density."""
    return np.stack([nodes, between], axis=1).reshape(2 * len(nodes), *nodes.shape[1:])


def interpolated(values: Array, period: float, t: Array) -> Array:
    """The trigonometric interpolant of nodes k T / N at the times t (M,), without the middle harmonic of an even count."""
    parts = np.ascontiguousarray(values).view(float)
    return FourierSeries.through(parts, period)(np.asarray(t, float)).view(values.dtype)


def tail(values: Array) -> float:
    """The largest harmonic of the upper half against the largest of all, entry by entry where that is not rounding."""
    spectrum = np.abs(np.fft.rfft(values, axis=0)).reshape(len(values) // 2 + 1, -1)
    whole = spectrum.max(axis=0)
    moving = spectrum[1:].max(axis=0) > ROOT_EPS * whole
    return float((spectrum[len(spectrum) // 2 :].max(axis=0)[moving] / whole[moving]).max()) if moving.any() else 0.0


def aliasing(values: Array) -> Array:
    """What harmonics beyond the nodes may add to a mean or a value in between: four times the largest of the top quarter.

    It covers harmonics that fall off like 1 / k^2, as after a corner.
    """
    spectrum = np.abs(np.fft.fft(values, axis=0)) / len(values)
    return 4 * spectrum[np.abs(harmonics(len(values))) > 3 / 8 * len(values)].max(axis=0)


def sylvester(B: Array, groups: tuple[Group, ...]) -> Array:
    """S (N, n, n) with B_ii S_ij - S_ij B_jj = -B_ij between groups i and j, zero inside the groups."""
    S, diagonal = np.zeros_like(B), np.einsum("tii->ti", B)
    scalar = np.repeat([group.size == 1 for group in groups], [group.size for group in groups])
    single = scalar[:, None] & scalar & ~np.eye(len(scalar), dtype=bool)
    S[:, single] = -B[:, single] / (diagonal[:, :, None] - diagonal[:, None, :])[:, single]
    large, alone = [group for group in groups if group.size > 1], np.flatnonzero(scalar)
    for group in large:  # with all that are alone, in one call each way
        apart = B[:, None, group.part, group.part] - diagonal[:, alone, None, None] * np.eye(group.size)
        columns = np.linalg.solve(apart, -np.swapaxes(B[:, group.part, alone], 1, 2)[..., None])[..., 0]
        S[:, group.part, alone] = np.swapaxes(columns, 1, 2)
        S[:, alone, group.part] = np.linalg.solve(np.swapaxes(apart, 2, 3), B[:, alone, group.part, None])[..., 0]
        for other in large:
            if other is not group:
                S[:, group.part, other.part] = solve_block(B, group, other)
    return S


def solve_block(B: Array, group: Group, other: Group) -> Array:
    """One block of S (N, p, q), column by column from the complex Schur form of the smaller diagonal block.

    Source: Bartels, Stewart, Solution of the matrix equation AX + XB = C, Comm. ACM 15 (1972).
    """
    if other.size > group.size:
        turned = -np.swapaxes(B, 1, 2)
        return -np.swapaxes(solve_block(turned, other, group), 1, 2)
    own, R = B[:, group.part, group.part], B[:, other.part, other.part]
    R, Q = (np.array(part) for part in zip(*map(complex_schur, R), strict=True))
    right, Y = -B[:, group.part, other.part] @ Q, np.empty((len(B), group.size, other.size), complex)
    for k in range(other.size):
        column = right[:, :, k] + (Y[:, :, :k] @ R[:, :k, k, None])[..., 0]
        Y[:, :, k] = np.linalg.solve(own - R[:, k, k, None, None] * np.eye(group.size), column[..., None])[..., 0]
    return Y @ np.conj(np.swapaxes(Q, 1, 2))


def mixing(S: Array) -> Array:
    """How far a step 1 + S would mix each pair of modes (n, n), whatever their scaling."""
    size = np.abs(S).max(axis=0)
    return np.sqrt(size * size.T)


def low_harmonics(S: Array, period: float, gap: Array) -> Array:
    """S (N, n, n) cut to the harmonics below SLOW_PART of the gap (n, n) that the nodes hold well."""
    frequency = 2 * np.pi / period * np.abs(harmonics(len(S)))[:, None, None]
    return weigh_harmonics(S, (frequency <= SLOW_PART * gap) & are_kept(len(S))[:, None, None])
