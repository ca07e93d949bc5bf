"""The sizes of an arm, from which an effect that the scene leaves out takes figures to be tried with."""

from dataclasses import dataclass

from flexlin.scene.links import Link

SLENDERNESS = 0.01
"""Radius of gyration of a section, relative to the link's length."""
PART = 0.1
"""A body that the scene leaves out, relative to the inertia that is there."""
LOSS = 0.01
"""Damping ratios, and friction relative to the inertia forces of the motion."""


@dataclass(frozen=True)
class Scale:
    """The sizes of an arm, stretched out and at rest.

    links: their tables; inertias: about the joint of each link, the largest where it is fixed (kg m^2); mass: of the links (kg);
    motion: frequency of the basic motion (rad/s);
    bending: slowest frequency of a link clamped alone (rad/s), None where no link bends.
    """

    links: tuple[Link, ...]
    inertias: tuple[float, ...]
    mass: float
    motion: float
    bending: float | None

    def of_inertias(self, factor: float) -> tuple[float, ...]:
        """Each joint's inertia times a factor."""
        return tuple(factor * inertia for inertia in self.inertias)
