"""A periodic linear system in coordinates in which its fast modes stand apart from the slow ones."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.decoupling.coupling import Coupled
from flexlin.periodic.decoupling.grouping import Group

UNRESOLVED = 0.5
"""Logs of multipliers with larger errors are ill-conditioned beyond measuring; they are only enclosed."""


@dataclass(frozen=True)
class Refusal:
    """Why a system was not decoupled: nothing stands apart, or its coefficients are not resolved by the nodes."""

    reason: str


@dataclass(frozen=True, eq=False)
class Decoupled:
    """Coordinates x = T(t) z that split x' = A(t) x into groups of modes.

        z' = B(t) z,   B = T^-1 (A T - T'),   B block diagonal up to `residual`

    times (N,) equidistant; frame T, inverse T^-1 and generator B (N, n, n), complex, values at the times; every other time took no
    part in the construction. groups: diagonal blocks; the modes of a group's partner are its complex conjugates. turning (G,):
    real groups whose basis is complex, since they turn within a period.
    residual (n, n): bound of what elimination of the coupling adds to the blocks; rounding (n, n): of B's entries; in 1/s.
    coupled: what was computed of its coupling, where that was looked at.
    """

    period: float
    times: Array
    frame: Array
    inverse: Array
    generator: Array
    groups: tuple[Group, ...]
    turning: Array
    residual: Array
    rounding: Array
    rounds: int
    coupled: Coupled | None = None

    def __repr__(self) -> str:
        sizes = [group.size for group in self.groups]
        return f"Decoupled(n={sum(sizes)}, groups={sizes}, nodes={len(self.times)}, rounds={self.rounds})"

    def traceless(self, index: int) -> tuple[Array, complex]:
        """The real generator (N, m, m) at the nodes of one group without its mean rotation and decay, and the mean that was taken out.

            w' = (B_g(t) - c(t)) w,   c = trace B_g / p:   exponents of the group = mean c + exponents of w

        A group of p modes with a complex basis is written as 2 p real states; that system holds the conjugates of the exponents too.
        """
        group = self.groups[index]
        B = self.generator[:, group.part, group.part]
        c = np.trace(B, axis1=1, axis2=2) / group.size
        if self.is_real(index):
            c = c.real
        B = B - c[:, None, None] * np.eye(group.size)
        return (B.real if self.is_real(index) else as_real(B)), complex(c.mean())

    def is_real(self, index: int) -> bool:
        """Whether a group's generator is real."""
        return self.groups[index].partner == index and not self.turning[index]


@dataclass(frozen=True)
class DecoupledExponents:
    """Exponents (n,) in 1/s by falling real part, imaginary parts in (-pi/T, pi/T], and their errors (n,)."""

    exponents: Array
    errors: Array


def as_real(B: Array) -> Array:
    """Complex matrices (..., p, p) as real ones [[Re, -Im], [Im, Re]] (..., 2p, 2p)."""
    return np.concatenate(
        [np.concatenate([B.real, -B.imag], axis=-1), np.concatenate([B.imag, B.real], axis=-1)], axis=-2
    )
