"""Modes whose shapes hardly change over a period: decoupled from the modes of the mean on, which nobody has to follow."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.coordinates import Coordinates, find_coordinates
from flexlin.periodic.decoupling.coupling import Coupled, combined, nearest_on_chords
from flexlin.periodic.decoupling.decouple import ROUGH
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.evidence import Uncertainty, with_evidence
from flexlin.periodic.decoupling.mean_modes import MeanModes, find_mean_modes
from flexlin.periodic.decoupling.parting import ADIABATIC, WORST
from flexlin.periodic.decoupling.superadiabatic import SLOW_PART
from flexlin.periodic.decoupling.tame import are_in_bands
from flexlin.periodic.decoupling.waves import harmonics, tail
from flexlin.periodic.system import MatrixFunction

COUNTS = (32, 64)
"""Nodes on which the coordinates are built: the second where the first do not suffice. As many between them check."""
LOOK = 8
"""Nodes of a first look."""
CLOSENESS = (0.25, ADIABATIC)
"""Modes stay together where the basic frequency exceeds this part of the gap between their eigenvalues: first few, then more."""
PARTED = 0.5
"""Modes whose real parts differ by this part of the basic frequency do not stay together: no harmonic meets their gap."""
MIXED = 0.35
"""Modes of the mean that A(t) mixes by more than this are followed instead."""
NARROWED, CLOSED = 0.7, 1e-3
"""Where the part NARROWED of a gap is not sure to be kept by how far two modes go from their means, it is measured at each time; where
the part CLOSED is not, it may close."""
HOPELESS, LASTING = 3.0, 100.0
"""Modes that a harmonic brings into resonance are put together at once where its effect exceeds what is allowed by the factor HOPELESS, and
stay so on more nodes; as do others that are coupled by the factor LASTING too much."""
JOINS = 1
"""How often on one set of nodes modes that stay coupled by too much are put together, those first whose excess is the part WORST of the
largest: what hinders these keeps the coupling of others from shrinking too. A second time seldom takes less than twice the nodes."""
FEW_STATES = 16
"""With so few states, more nodes are tried even where these seldom part modes that are coupled by so much: it costs little."""


@dataclass(frozen=True)
class Remaining:
    """The mode that each of the worst modes stays coupled with, -1 for the others (n,); and whether they do so on any nodes."""

    partner: Array
    lasting: bool


def decouple_steady(
    A: MatrixFunction, period: float, harmonics: int, tol: float = 1e-9, uncertainty: Uncertainty | None = None
) -> Decoupled | Refusal:
    """Split x' = A(t) x into groups of modes as `decouple` does, where A(t) mixes the modes of its mean by little.

        x = V P(t) z,   z' = B(t) z,   B = P^-1 (V^-1 A V P - P') block diagonal,   V the eigenvectors of the mean

    The evidence is that of `decouple`: B at the nodes that made P and half-way between them, couplings and rounding left in it.

    Parameters: harmonics: of the series that A is made of, so that nothing hides between the nodes; the others as of `decouple`.
    Assumes A smooth on the circle.
    """
    counts = [count for count in COUNTS if harmonics < count]
    if not counts:
        return Refusal("A(t) has too many harmonics")

    @cache
    def sample(count: int) -> Array:
        """A at N nodes and half-way between them."""
        return A(period / (2 * count) * np.arange(2 * count))

    def once(count: int, modes: MeanModes) -> Decoupled | Remaining | None:
        return decouple_on_nodes(sample(count), modes, period, tol, uncertainty)

    look = sample(counts[0])[:: 2 * counts[0] // LOOK]
    answer, before = Refusal("A(t) mixes the modes of its mean"), None
    for closeness in CLOSENESS:
        modes = find_mean_modes(look.mean(axis=0), 2 * np.pi / period / closeness, PARTED * 2 * np.pi / period)
        if isinstance(modes, Refusal):
            return modes
        if not may_be_tame(modes, period):
            return Refusal("modes of one group grow or decay by much against each other")
        if modes.groups == before or mix_at_first(modes.left @ look @ modes.right, modes) > MIXED:
            continue
        done, before = part_modes(modes, counts, period, once), modes.groups
        if done is not None:
            return done  # a refusal too: groups of more modes would part no less
        answer = Refusal("the coupling of the modes does not shrink enough")
    return answer


def part_modes(
    modes: MeanModes, counts: list[int], period: float, once: Callable[[int, MeanModes], Decoupled | Remaining | None]
) -> Decoupled | Refusal | None:
    """Decouple `once`, with modes put together that resonate or stay coupled by too much; where that does not serve, on more nodes.

    There they begin anew, but for those that resonate, or are coupled by so much that more nodes would not part them.
    """
    at = joins = 0
    begun = modes
    while True:
        done = once(counts[at], modes)
        if isinstance(done, Decoupled):
            return done
        left = done if done is not None and done.partner.max() >= 0 and joins < JOINS else None
        joined = None if left is None else try_joining(modes, left, period)
        if left is not None and joined is not None:
            modes, joins, begun = joined, joins + 1, joined if left.lasting else begun
        elif at < len(counts) - 1 and not (left is not None and left.lasting and len(modes.values) > FEW_STATES):
            at, joins, modes = at + 1, 0, begun
        else:
            return (
                Refusal("modes that stay coupled grow or decay by much against each other")
                if left is not None
                else None
            )


def try_joining(modes: MeanModes, left: Remaining, period: float) -> MeanModes | None:
    """The modes, with those put together that stay coupled; None where all join, or such groups cannot be tame."""
    joined = modes.joined(left.partner)
    return joined if joined is not None and may_be_tame(joined, period) else None


def decouple_on_nodes(
    A: Array, modes: MeanModes, period: float, tol: float, uncertainty: Uncertainty | None
) -> Decoupled | Remaining | None:
    """Decouple on every other of the nodes at which A (N, n, n) is given.

    Where the others do not agree to tol, or the coupling is not small enough: which modes stay coupled most; None where gaps close, or A is
    not resolved.
    """
    if tail(A[::2]) > ROUGH:
        return None
    allowed = tol * np.maximum(1, np.abs(modes.values.real))  # imaginary parts of exponents are folded
    found = find_coordinates(modes.left @ A @ modes.right, modes, period, allowed)
    if found.resonance.max() > HOPELESS:
        return find_remaining(found.resonance.max(axis=1), found.resonance.argmax(axis=1), True)
    bounds = bound_residual(found.generator, modes, period)
    if bounds is None:
        return None
    done, slope = in_states(found, modes, period, bounds[0])
    coupled = Coupled(done.generator, period, done.groups)
    reached = tol * np.maximum(1, np.abs(np.einsum("tii->ti", done.generator).real.mean(axis=0)))
    done, agree, parted = with_evidence(done, coupled, slope, A, reached, uncertainty)
    if np.all(agree & parted):
        return done
    excess = np.where(agree & ~parted, np.diagonal(done.residual) / reached, 0.0)
    return find_remaining(excess, bounds[1], bool(excess.max() > LASTING))


def find_remaining(excess: Array, partner: Array, lasting: bool) -> Remaining:
    """Those whose coupling exceeds what is allowed by at least the part WORST of the largest."""
    return Remaining(np.where((excess > 0) & (excess >= WORST * excess.max()), partner, -1), lasting)


def may_be_tame(modes: MeanModes, period: float) -> bool:
    """Whether the groups are ones of which perturbation theory says all: real, and of modes that can be followed over a period."""
    several = [(i, group) for i, group in enumerate(modes.groups) if group.size > 1]
    return all(group.partner == i and are_in_bands(modes.values.real[group.part] * period) for i, group in several)


def mix_at_first(own: Array, modes: MeanModes) -> float:
    """How far A(t) mixes two modes of its mean that are not in one group, at most."""
    gap = np.where(modes.outside, np.abs(modes.values[:, None] - modes.values), np.inf)
    size = np.abs(own).max(axis=0) / gap
    return float((size * size.T).max()) ** 0.5


def in_states(found: Coordinates, modes: MeanModes, period: float, residual: Array) -> tuple[Decoupled, Array]:
    """The decoupled system in the coordinates of the states, real groups with real columns; and the slope of its frame."""
    T, slope, inverse, B = modes.right @ found.P, modes.right @ found.slope, found.inverse @ modes.left, found.generator
    for i, group in enumerate(modes.groups):
        if group.partner == i and group.size > 1:
            U, part = modes.real_columns(group), group.part
            for columns in (T, slope, B):
                columns[:, :, part] = columns[:, :, part] @ U
            for rows in (inverse, B):
                rows[:, part] = U.conj().T @ rows[:, part]
            residual[part, part] = np.abs(U.conj().T) @ residual[part, part] @ np.abs(U)
    times = period / len(T) * np.arange(len(T))
    turning = np.zeros(len(modes.groups), bool)
    return Decoupled(
        period, times, T, inverse, B, modes.groups, turning, residual, np.zeros_like(residual), found.rounds
    ), slope


def bound_residual(B: Array, modes: MeanModes, period: float) -> tuple[Array, Array] | None:
    """Bound what the coupling adds to each block when the other modes are eliminated (n, n), as `residual_effect` does; None: no bound.

    And the mode that adds most to each (n,).

    The diagonal of B (N, n, n) stays near its mean, and so do the gaps: from below,

        |b_i - b_j| >= |m_i - m_j| - d_i - d_j,   m the means of the diagonal, d the largest deviations from them

    and else are measured at the times, and on straight lines between them. What blocks hold beside their diagonals may close a gap further.
    """
    b = np.diagonal(B, axis1=1, axis2=2)
    mean = b.mean(axis=0)
    moved = b - mean
    size = np.abs(B).max(axis=0)
    inner = np.where(modes.outside, 0, size).sum(axis=1) - np.diagonal(size)
    away = np.abs(moved).max(axis=0) + inner
    damped = np.abs(moved.real).max(axis=0) + inner
    outside = modes.outside
    whole = np.abs(mean[:, None] - mean)
    gap = np.where(outside, whole - away[:, None] - away, np.inf)
    i, j = np.nonzero(gap < NARROWED * whole)
    gap[i, j] = np.maximum(gap[i, j], nearest_on_chords(b[:, i] - b[:, j]) - inner[i] - inner[j])
    if not np.all(gap > CLOSED * whole):
        return None
    parted = np.maximum(np.abs(mean.real[:, None] - mean.real) - damped[:, None] - damped, 0)
    oblique = np.divide(gap, parted, out=np.full_like(gap, np.inf), where=outside & (parted > 0))
    run = np.ptp(np.cumsum(moved.real, axis=0), axis=0) * period / len(B)
    swing = np.exp(np.minimum(run[:, None] + run, 600.0))
    frequency = 2 * np.pi / period * np.abs(harmonics(len(B)))[:, None, None]
    high = (np.abs(np.fft.fft(B, axis=0)) * (frequency >= SLOW_PART * gap)).sum(axis=0) / len(B)
    R = np.where(outside, size, 0)
    Z = R / gap
    parts = combined(R * Z.T, np.sqrt(high * high.T), oblique, swing)
    total = np.diag(parts.sum(axis=1))
    for part in (group.part for group in modes.groups if group.size > 1):
        second, first = (X[part, :, None] * Y[None, :, part] for X, Y in ((R, Z), (high, high)))
        total[part, part] = combined(second, np.sqrt(first), oblique[part, :, None], swing[part, :, None]).sum(axis=1)
    return total, np.where(parts.max(axis=1) > 0, parts.argmax(axis=1), -1)
