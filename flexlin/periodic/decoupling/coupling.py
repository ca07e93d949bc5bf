"""A decoupled system: its groups of modes, and what the coupling that is left between them does to the exponents."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.decoupling.frames import SLOW_PART, Group, block_mask, connected, sylvester
from flexlin.periodic.interpolation import circle_derivative, harmonics, weigh_harmonics
from flexlin.precision import LARGEST_LOG_GROWTH, SLIGHT, TINY

HIDING_GROWTH = 8.0
"""Modes that grow by less than exp(HIDING_GROWTH) against each other within a period do not bring out what is hidden."""
UNRESOLVED_LOG = 0.5
"""Logs of multipliers with larger errors are ill-conditioned beyond measuring; they are only enclosed."""


@dataclass(frozen=True)
class Separation:
    """How far the groups of each pair of modes stay apart (n, n): least gap of eigenvalues at the nodes; the gap's ratio to the least
    difference of real parts of one sign (inf: none); how much one may grow against the other within the period. outside: not in
    one group."""

    gap: Array
    oblique: Array
    swing: Array
    outside: Array


@dataclass(frozen=True, eq=False)
class Decoupled:
    """Coordinates x = T(t) z that split x' = A(t) x into groups of modes.

        z' = B(t) z,   B = T^-1 (A T - T'),   B block diagonal up to `residual`

    times (N,) equidistant; frame T and generator B (N, n, n), complex, values at the times; every other time took no part in the
    construction. groups: diagonal blocks; the modes of a group's partner are its complex conjugates. rounding (n, n): of B's entries, in
    1/s. What is left of the coupling is looked at when it is asked for.
    """

    period: float
    times: Array
    frame: Array
    generator: Array
    groups: tuple[Group, ...]
    rounding: Array

    def __repr__(self) -> str:
        sizes = [group.size for group in self.groups]
        return f"Decoupled(n={sum(sizes)}, groups={sizes}, nodes={len(self.times)})"

    def is_real(self, index: int) -> bool:
        """Whether a group's generator is real."""
        return self.groups[index].partner == index and not self.groups[index].turning

    def traceless(self, index: int) -> tuple[Array, complex]:
        """The real generator (N, m, m) at the nodes of one group without its mean rotation and decay, and the mean that was taken out.

            w' = (B_g(t) - c(t)) w,   c = trace B_g / p:   exponents of the group = mean c + exponents of w

        A group of p modes with a complex basis is written as 2 p real states; that system holds the conjugates of the exponents too.
        """
        group = self.groups[index]
        B = self.generator[:, group.part, group.part]
        c = np.trace(B, axis1=1, axis2=2) / group.size
        B, mean = B - c[:, None, None] * np.eye(group.size), complex(c.mean())
        return (B.real, complex(mean.real)) if self.is_real(index) else (as_real(B), mean)

    @lazy
    def values(self) -> Array:
        """The eigenvalues of the diagonal blocks (N, n)."""
        return block_values(self.generator, self.groups)

    @lazy
    def apart(self) -> Separation:
        return group_separation(self.values, self.period, self.groups)

    @lazy
    def S(self) -> Array:
        return sylvester(self.generator, self.groups)

    @lazy
    def size(self) -> Array:
        """The largest size of each entry of B (n, n)."""
        return np.abs(self.generator).max(axis=0)

    @lazy
    def rough(self) -> Array:
        """The part of each entry of B that may meet a resonance (n, n)."""
        return measure_rough(self.generator, self.period, self.apart.gap)

    @lazy
    def eliminated(self) -> Array:
        """Bound of what the coupling adds to each diagonal block when the other modes are eliminated, entry by entry (n, n), in 1/s.

            d B_kl ~ sum over j outside of  B_kj S_jl,   S of the Sylvester equations

        Where the real parts of two groups stay apart by r, elimination needs no smoothness and costs gap / r more. Elsewhere the
        harmonics of B above SLOW_PART of the gap could meet the modes' beat in resonance: they enter at first order,
        c = sqrt(|B_kj B_jl|) times what one mode may grow against the other within the period.

        Source: Coppel, Dichotomies in Stability Theory (1978), for the first; Yakubovich, Starzhinskii (1975), IV, for the second.
        """
        outside, oblique, swing = (x[:, :, None] for x in (self.apart.outside, self.apart.oblique, self.apart.swing))
        second = self.size[:, :, None] * np.abs(self.S).max(axis=0)
        both = combined(second, np.sqrt(self.rough[:, :, None] * self.rough), oblique, swing)
        return np.where(self.apart.outside, 0, np.where(outside, both, 0).sum(axis=1))

    @lazy
    def hidden(self) -> Array:
        """Bound of what couplings that no round can take away add to each diagonal block, entry by entry (n, n), where damping crosses.

            d lambda_i ~ c^2 / max(|lambda_i - lambda_j|, c),   c^2 = F_ij F_ji exp(g_ij)

        A mode that falls behind another by exp(g) and catches up again follows the other one in between, if as little as exp(-g / 2) of
        it goes over and comes back, however smooth A is.

        Source: Berry, Uzdin, Slow non-Hermitian cycling, J. Phys. A 44 (2011), 435303.
        """
        own, period = np.einsum("tii->ti", self.generator), self.period
        logs = own.mean(axis=0) * period
        run = np.cumsum((own * period - logs).real, axis=0) / len(own)
        if np.sort(np.ptp(run, axis=0))[-2:].sum() < HIDING_GROWTH:
            return np.zeros_like(self.rounding)
        single = np.repeat([g.size == 1 for g in self.groups], [g.size for g in self.groups])
        gap = np.where(single[:, None] & single, measure_distances(logs, logs) / period, 0)
        size = np.sqrt(self.missed[:, :, None] * self.missed) * self.catch_up[:, :, None]
        share = size / np.maximum(np.maximum(gap[:, :, None], size), TINY)
        return np.where(self.apart.outside, 0, (size * share).sum(axis=1))

    @lazy
    def residual(self) -> Array:
        """Bound of what the coupling adds to the blocks (n, n), in 1/s."""
        return self.eliminated + self.hidden

    @lazy
    def missed(self) -> Array:
        """F = B exp(-1 / r) + rounding (n, n) of modes whose damping crosses: rounds that shrink the coupling B by r end there.

        Source: Berry, Histories of adiabatic quantum transitions, Proc. R. Soc. A 429 (1990).
        """
        moved = np.abs(circle_derivative(self.S, self.period)).max(axis=0)
        shrunk = np.exp(-self.size / np.maximum(moved, SLIGHT * self.size + TINY))
        return np.where(self.apart.outside & np.isinf(self.apart.oblique), self.size * shrunk + self.rounding, 0)

    @lazy
    def catch_up(self) -> Array:
        """exp(g / 2) - 1 with the largest growth g of one mode against another one that grows more over a whole period, (n, n); groups by
        their means."""
        mean = average_groups(self.values.real, self.groups)
        behind = mean[:, :, None] - mean[:, None, :]
        behind *= -np.sign(behind.mean(axis=0))
        run = np.cumsum(np.concatenate([behind, behind]), axis=0) * self.period / len(mean)
        growth = (run - np.minimum.accumulate(run, axis=0)).max(axis=0)
        return np.asarray(np.expm1(np.minimum(growth, LARGEST_LOG_GROWTH) / 2))

    @lazy
    def enclosures(self) -> tuple[Array, Array]:
        """Bounds from below and above on the real part of each exponent (n,): the means of the least and the largest of modes that are
        linked: as far as anybody can see one may go over to the other and come back, so these may take each other's place at any time."""
        with np.errstate(invalid="ignore"):
            seen = np.sqrt(self.rough * self.rough.T) * self.apart.swing
        strength = np.maximum(seen, np.sqrt(self.missed * self.missed.T) * self.catch_up)
        linked = (strength * self.period > SLIGHT) & self.apart.outside & np.isinf(self.apart.oblique)
        member = connected(linked | ~self.apart.outside)
        together, real = member[:, None] == member, self.values.real[:, :, None]
        low, high = np.where(together, real, np.inf).min(axis=1), np.where(together, real, -np.inf).max(axis=1)
        return low.mean(axis=0), high.mean(axis=0)


def block_values(B: Array, groups: tuple[Group, ...]) -> Array:
    """The eigenvalues (N, n) of the diagonal blocks of B (N, n, n)."""
    values = np.einsum("tii->ti", B).copy()
    for i, g in enumerate(groups):
        if g.partner < i:
            values[:, g.part] = values[:, groups[g.partner].part].conj()
        elif g.size > 1:
            values[:, g.part] = np.linalg.eigvals(B[:, g.part, g.part])
    return values


def group_separation(values: Array, period: float, groups: tuple[Group, ...]) -> Separation:
    """The separations of the groups from the eigenvalues (N, n) of their blocks."""
    starts, size = np.array([g.start for g in groups]), [g.size for g in groups]

    def least(pairs: Array) -> Array:
        small = np.minimum.reduceat(np.minimum.reduceat(pairs, starts, axis=0), starts, axis=1)
        return np.repeat(np.repeat(small, size, axis=0), size, axis=1)

    apart = values[:, :, None] - values[:, None, :]
    gap = least(np.abs(apart).min(axis=0))
    above = least((values.real[:, :, None] - values.real[:, None, :]).min(axis=0))
    damping = np.maximum(0, np.maximum(above, above.T))
    mean = average_groups(values.real, groups)
    run = np.cumsum(mean - mean.mean(axis=0), axis=0) * period / len(values)
    swing = np.ptp(run[:, :, None] - run[:, None, :], axis=0)
    oblique = np.divide(gap, damping, out=np.full_like(gap, np.inf), where=damping > 0)
    return Separation(gap, oblique, np.exp(np.minimum(swing, LARGEST_LOG_GROWTH)), ~block_mask(groups))


def average_groups(values: Array, groups: tuple[Group, ...]) -> Array:
    """Each of values (N, n) replaced by the mean of its group."""
    size = [g.size for g in groups]
    return np.repeat(np.add.reduceat(values, [g.start for g in groups], axis=1) / size, size, axis=1)


def combined(second: Array, first: Array, oblique: Array, swing: Array) -> Array:
    """The lesser of two bounds: by damping, second-order and oblique; or second-order and a resonance of first order."""
    with np.errstate(invalid="ignore"):
        by_damping = np.where(second == 0, 0, second * oblique)
    return np.minimum(by_damping, second / (1 - SLOW_PART) + first * swing)


def measure_rough(R: Array, period: float, gap: Array) -> Array:
    """The largest size of the part of couplings (N, n, n) whose frequencies lie above SLOW_PART of their gaps (n, n)."""
    frequency = 2 * np.pi / period * np.abs(harmonics(len(R)))[:, None, None]
    return np.asarray(np.abs(weigh_harmonics(R, frequency >= SLOW_PART * gap)).max(axis=0))


@dataclass(frozen=True)
class DecoupledExponents:
    """Exponents (n,) in 1/s by falling real part, imaginary parts in (-pi/T, pi/T], and their errors (n,)."""

    exponents: Array
    errors: Array


def as_real(B: Array) -> Array:
    """Complex matrices (..., p, p) as real ones [[Re, -Im], [Im, Re]] (..., 2p, 2p)."""
    return np.block([[B.real, -B.imag], [B.imag, B.real]])
