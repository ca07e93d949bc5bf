"""Shear (Timoshenko): the axis' slope and the section's rotation part, V = 1/2 int kappa G A (w' - psi)^2.

Each assumed mode has a deflection X and a rotation psi of its own, the modes of Timoshenko's beam with these ends; so shear adds no
coordinate, and none of the fast motions in which the sections turn against the axis. With rotary inertia this is Timoshenko's beam;
kappa G A to infinity leaves Euler-Bernoulli's. Source: Timoshenko (1921).
"""

from collections.abc import Iterator
from typing import Annotated, Any, Optional

import casadi as ca

from flexlin.errors import Problem
from flexlin.mechanics.effects.base import SLENDERNESS, Chain, Effect, Scale, per_joint
from flexlin.mechanics.links import BentLink
from flexlin.scene.base import AllPositive, Unit
from flexlin.scene.effects import RawArm, RawTable


class Shear(Effect):
    """Timoshenko's shear of the links, by its stiffness kappa G A; one number for every link or one a link."""

    smooth = True
    lists = "each"
    stiffness: Annotated[AllPositive, Unit("N")]
    """Shear stiffness kappa G A of the sections."""

    @classmethod
    def tried_with(cls, scale: Scale) -> Optional["Shear"]:
        """Rectangular sections of steel or aluminium, of which kappa G / E is 0.32."""
        if scale.bending is None:
            return None
        stiffness = [
            0.32 * (link.stiffness_in("y") or 1.0) / (SLENDERNESS * (link.length or 1.0)) ** 2 for link in scale.links
        ]
        return cls(stiffness=tuple(stiffness))

    @classmethod
    def contradictions(cls, raw: RawTable, arm: RawArm) -> Iterator[Problem]:
        """The shipped finite elements do not shear."""
        for i, link in enumerate(arm.links):
            if link.get("mode_shapes") == "finite-element":
                expected = "other shapes beside effects.shear, because these elements do not shear"
                yield Problem(f"links.{i}.mode_shapes", "'finite-element'", expected)

    def section_shear(self, link: int) -> Any:
        return per_joint(self.stiffness, link)

    def potential_energy(self, chain: Chain) -> ca.SX:
        return sum((self._of_link(link) for link in chain.links if link.bending), ca.SX(0))

    def _of_link(self, link: BentLink) -> ca.SX:
        stiffness = per_joint(self.stiffness, link.index) / ca.SX(link.table.length)
        return stiffness * sum((part.quadratic(part.integrals.shear)[0] for part in link.bending), ca.SX(0))
