"""Flexible links as rigid segments with torsion springs between them: an independent model that shares no code with the chain.

Each link of length l is cut at N springs k = EI N / l, half a segment at both ends; absolute angles phi of the bodies.
T = 1/2 sum_ij a_ij cos(phi_i - phi_j) phi_i' phi_j'. Source: the rigid finite element method, Wittbrodt, Adamiec-Wojcik, Wojciech (2006).
"""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array


@dataclass(frozen=True)
class Segments:
    """a (n, n) and springs (n - 1,), zero where a joint is free; `first` are the bodies that joints carry."""

    a: Array
    springs: Array
    first: tuple[int, ...]

    @classmethod
    def of_links(cls, links: list[dict[str, float]], per_link: int, tip_mass: float = 0.0) -> "Segments":
        lengths, masses, springs, first = [], [], [], []
        for link in links:
            h = link["length"] / per_link
            own = np.array([h / 2, *[h] * (per_link - 1), h / 2])
            first.append(len(lengths))
            if lengths:
                springs.append(0.0)
            springs += [link["bending_stiffness"] / h] * per_link
            lengths += own.tolist()
            masses += (own * link["mass_per_length"]).tolist()
        length, mass = np.array(lengths), np.array(masses)
        beyond = np.append(np.cumsum(mass[::-1])[::-1][1:], 0.0) + tip_mass
        # body j moves with body i < j rigidly attached at i's end: lever l_i times (m_j / 2 + all beyond j) l_j
        a = np.outer(length, length * (mass / 2 + beyond))
        a = np.triu(a, 1)
        a = a + a.T + np.diag(length**2 * (mass / 3 + beyond))
        return cls(a, np.array(springs), tuple(first))

    def mass(self, phi: Array) -> Array:
        """M(phi)."""
        return self.a * np.cos(phi[:, None] - phi)

    def stiffness(self) -> Array:
        """The springs' stiffness matrix."""
        difference = np.diff(np.eye(len(self.a)), axis=0)
        return difference.T @ (self.springs[:, None] * difference)
