"""Part groups of modes on given nodes: group, build the frame, make the rounds, and put together what does not part."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.coupling import block_values, group_separation, high_harmonics, pair_effects
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.grouping import Eigenvectors, Group, find_frame, follow_modes, grouped_modes
from flexlin.periodic.decoupling.superadiabatic import (
    SLOW_PART,
    circle_derivative,
    interleaved,
    low_harmonics,
    mixing,
    rounds,
    shifted,
    smooth,
    sylvester,
)
from flexlin.periodic.precision import EPS, MINOR, PARTIAL, SLIGHT
from flexlin.periodic.product.spectrum import GROUP_CONDITION

ADIABATIC = 0.05
"""Modes stay together where the basic frequency exceeds this part of the gap between their eigenvalues at some time."""
HOPELESS = 300.0
"""On the fewest nodes, modes are put together only where their coupling exceeds what is allowed by this factor: others may part on more."""
MAX_ROUNDS, MAX_MERGES = 14, 12
SPARSE = 4
"""Means of rounding are taken at every so many nodes: it changes slowly."""


@dataclass(frozen=True)
class Frame:
    """Groups of modes, a basis T (N, n, n) of their subspaces, the real groups whose basis is complex (G,), the least size of each
    eigenvalue (n,)."""

    groups: tuple[Group, ...]
    T: Array
    turning: Array
    size: Array

    def doubled(self) -> "Frame":
        """The same on twice the nodes."""
        return replace(self, T=interleaved(self.T, shifted(self.T, 0.5)))


@dataclass(frozen=True)
class Parted:
    """What the rounds reached from a frame: the pairs of modes (n, n) whose coupling stays too large, and by which factor at the most."""

    decoupled: Decoupled
    stuck: Array
    excess: float
    size: Array

    @property
    def frame(self) -> Frame:
        return Frame(self.decoupled.groups, self.decoupled.frame, self.decoupled.turning, self.size)


def built_on(
    samples: Array, vectors: Eigenvectors, joined: Array, period: float, tol: float, tries: int, few: bool
) -> Parted | Refusal | None:
    """Group, build the frame and make the rounds on one set of nodes, putting modes together that do not part.

    On the fewest nodes, `few`, what more nodes may part is handed back as it is, or None where all modes are one group; what they would
    not part is added to `joined` (n, n).
    """
    modes = follow_modes(vectors)
    apart = np.abs(modes.values[:, :, None] - modes.values[:, None, :]).min(axis=0)
    together = joined | (apart < 2 * np.pi / period / ADIABATIC)
    for _ in range(tries):
        columns, groups = grouped_modes(modes, together)
        if len(groups) == 1:
            return None if few else Refusal("no eigenvalues of A(t) stand apart from the others along the period")
        taken = modes.taken(columns)
        T, turning = find_frame(taken, groups)
        found = part_frame(Frame(groups, smooth(T), turning, np.abs(taken.values).min(axis=0)), samples, period, tol)
        stuck = found.stuck
        if not stuck.any() or (few and found.excess < HOPELESS):
            return found
        pairs = np.ix_(columns, columns)
        together[pairs] |= stuck | stuck.T
        joined[pairs] |= few & (stuck | stuck.T)
    return Refusal("the coupling between groups of modes does not shrink")


def part_frame(frame: Frame, A: Array, period: float, tol: float) -> Parted:
    """Make the rounds from a frame on its nodes, where no first step would mix modes by much."""
    T, groups = frame.T, frame.groups
    B = np.linalg.solve(T, A @ T - circle_derivative(T, period))
    S = sylvester(B, groups)
    share = mixing(S)
    stuck, excess, made = share > MINOR, np.inf, 0
    if not stuck.any():
        allowed = tol * np.maximum(1, frame.size)[:, None]
        T, B, S, made, left = part_groups(T, B, S, groups, period, allowed)
        stuck = left > MINOR * allowed + transformation_noise(T, A)
        share, excess = mixing(S), float((left / allowed)[stuck].max(initial=0.0))
    if (strongest := share[stuck].max(initial=0.0)) > SLIGHT:  # put those together that mix the most
        stuck &= share >= PARTIAL * strongest
    none = np.zeros(stuck.shape)
    parted = Decoupled(period, np.empty(0), T, T, B, groups, frame.turning, none, none, made)
    return Parted(parted, stuck, excess, frame.size)


def part_groups(
    T: Array, B: Array, S: Array, groups: tuple[Group, ...], period: float, allowed: Array
) -> tuple[Array, Array, Array, int, Array]:
    """Make the rounds: T, B, S, how many were made, and what the coupling that is left does to each mode by each other one (n, n)."""
    apart = group_separation(block_values(B, groups), period, groups)
    apart = replace(apart, swing=np.minimum(apart.swing, GROUP_CONDITION))
    i, j = np.nonzero(apart.outside & (SLOW_PART * apart.gap < np.pi / period * len(B)))

    def measure(B: Array, S: Array) -> Array:
        rough = np.zeros(apart.gap.shape)
        rough[i, j] = np.abs(high_harmonics(B[:, i, j], period, apart.gap[i, j])).max(axis=0)
        return pair_effects(B, S, apart, rough)

    def effect(B: Array, S: Array) -> Array:
        return measure(B, S) / (MINOR * allowed)  # couplings of a group add up, and it may amplify them

    T, B, S, made = rounds(B, T, S, groups, lambda S: low_harmonics(S, period, apart.gap), effect, MAX_ROUNDS)
    return T, B, S, made, measure(B, S)


def transformation_noise(T: Array, A: Array) -> Array:
    """Rounding of T^-1 A T, entry by entry (n, n); looked at where evidence looks at it."""
    T, A = T[::SPARSE], A[::SPARSE]
    size = np.abs(np.linalg.inv(T)) @ (np.abs(A) @ np.abs(T))
    rounding = 30 * EPS * size.max(axis=0)
    return np.sqrt(rounding * rounding.T)
