"""The modes of the mean of A(t): where they serve all along the period, no mode has to be followed."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.periodic.decoupling.decoupled import Refusal
from flexlin.periodic.decoupling.grouping import Group

LARGEST = 1e7
"""Eigenvectors of the mean with a larger condition number, in the best units of the states, are none to build on."""


@dataclass(frozen=True, eq=False)
class MeanModes:
    """Eigenvalues (n,) in 1/s of the mean of A, right vectors (n, n) as columns and left ones as rows, the conjugate of each (n,).

    groups: modes whose eigenvalues lie close together stand side by side.
    """

    values: Array
    right: Array
    left: Array
    mate: Array
    groups: tuple[Group, ...]

    @lazy
    def label(self) -> Array:
        """The number of each mode's group (n,)."""
        return np.array([i for i, group in enumerate(self.groups) for _ in range(group.size)], dtype=np.intc)

    @lazy
    def outside(self) -> Array:
        """Pairs of modes that are not in one group (n, n)."""
        return np.asarray(self.label[:, None] != self.label)

    def joined(self, partner: Array) -> "MeanModes | None":
        """The same modes with each in one group with its partner (n,), -1 for none, and the conjugates likewise; None where all join."""
        together, some = ~self.outside, np.flatnonzero(partner >= 0)
        together[some, partner[some]] = together[self.mate[some], self.mate[partner[some]]] = True
        columns, groups = group_neighbours(self.mate.tolist(), (together | together.T).tolist())
        if len(groups) == 1:
            return None
        mate = np.argsort(columns)[self.mate[columns]].astype(np.intc)
        right, left = (np.ascontiguousarray(part) for part in (self.right[:, columns], self.left[columns]))
        return MeanModes(self.values[columns], right, left, mate, groups)

    def real_columns(self, group: Group) -> Array:
        """A unitary matrix (p, p) that makes the vectors of a real group real: sqrt 2 Re v and sqrt 2 Im v for v and its conjugate."""
        mate, U = self.mate[group.part] - group.start, np.eye(group.size, dtype=complex)
        for j in np.flatnonzero(mate > np.arange(group.size)).tolist():
            U[np.ix_([j, mate[j]], [j, mate[j]])] = np.array([[1, -1j], [1, 1j]]) / np.sqrt(2)
        return U


def find_mean_modes(mean: Array, closest: float, parted: float = np.inf) -> MeanModes | Refusal:
    """The modes of the mean (n, n), in groups of eigenvalues closer together than `closest` 1/s, and than `parted` in their real parts."""
    values, vectors = np.linalg.eig(mean)
    gap = values[:, None] - values
    together = (np.abs(gap) < closest) & (np.abs(gap.real) < parted)
    if together.all():
        return Refusal("no eigenvalues of the mean of A(t) stand apart")
    mates = np.abs(values.conj()[:, None] - values).argmin(axis=1).tolist()
    if any(mates[mate] != i for i, mate in enumerate(mates)):
        return Refusal("eigenvalues of the mean of A(t) coincide")
    columns, groups = group_neighbours(mates, together.tolist())
    if len(groups) == 1:
        return Refusal("no eigenvalues of the mean of A(t) stand apart")
    right = np.ascontiguousarray(vectors[:, columns], dtype=complex)
    try:
        left = np.linalg.inv(right)
        left += (np.eye(len(right)) - left @ right) @ left  # right to its last digits however unlike the units are
    except np.linalg.LinAlgError:
        return Refusal("the eigenvectors of the mean of A(t) depend on each other")
    if not np.linalg.norm(np.abs(left) @ np.abs(right)) < LARGEST:  # whatever the units of the states
        return Refusal("the eigenvectors of the mean of A(t) depend on each other")
    place = {column: i for i, column in enumerate(columns)}
    mate = np.array([place[mates[column]] for column in columns], dtype=np.intc)
    return MeanModes(values[columns].astype(complex), right, left, mate, groups)


def group_neighbours(mate: list[int], together: list[list[bool]]) -> tuple[list[int], tuple[Group, ...]]:
    """Put modes together that are connected by neighbours: the order of the modes, and the groups in it, those of conjugates in a row.

    Conjugates are neighbours where the modes are, so the conjugates of a group are a group too.
    """
    label = [-1] * len(mate)
    members: list[list[int]] = []
    for first in range(len(mate)):
        if label[first] >= 0:
            continue
        members.append([first])
        label[first] = len(members) - 1
        for i in members[-1]:
            for j, near in enumerate(together[i]):
                if near and label[j] < 0:
                    label[j] = label[first]
                    members[-1].append(j)
    columns: list[int] = []
    groups: list[Group] = []
    for i, own in enumerate(members):
        start, size, other = len(columns), len(own), label[mate[own[0]]]
        if other == i:
            groups.append(Group(start, start + size, len(groups)))
            columns += own
        elif other > i:
            groups += [Group(start, start + size, len(groups) + 1), Group(start + size, start + 2 * size, len(groups))]
            columns += own + [mate[k] for k in own]
    return columns, tuple(groups)
