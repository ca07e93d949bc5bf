"""Rotary inertia: the sections of a link turn, in the plane T = 1/2 int rho I (q' + psi')^2, psi = w'_x without shear.

With the radius of gyration r about z, rho I_z = rho A r^2; a section's inertia about y is what its polar inertia leaves. Sections that
turn out of the plane of rotation are pulled back into it: the propeller moment. Source: Rayleigh, Theory of Sound (1877), section 186.
"""

from collections.abc import Iterator
from math import sqrt
from typing import Annotated, Any

from flexlin.errors import Problem
from flexlin.mechanics.effects.base import SLENDERNESS, Effect, Scale, per_joint
from flexlin.mechanics.links import BentLink
from flexlin.precision import SLIGHT
from flexlin.scene.base import PerLink, Unit
from flexlin.scene.effects import RawArm, RawTable


class RotaryInertia(Effect):
    """The inertia of the links' sections, by their radius of gyration sqrt(I/A); one number for every link or one a link."""

    smooth = True
    lists = "each"
    radius_of_gyration: Annotated[PerLink, Unit("m")]
    """Radius of gyration sqrt(I/A) of the sections."""

    @classmethod
    def contradictions(cls, raw: RawTable, arm: RawArm) -> Iterator[Problem]:
        """A section's polar inertia is the sum of those about z and about y, so neither is larger."""
        given = raw.get("radius_of_gyration")
        for i, link in enumerate(arm.links):
            own: Any = given[i] if isinstance(given, list) and i < len(given) else given
            figures: list[Any] = [own, link.get("polar_inertia"), link.get("mass_per_length")]
            if all(isinstance(one, int | float) and one > 0 for one in figures):
                most = sqrt(figures[1] / figures[2])
                if own > (1 + SLIGHT) * most:
                    expected = f"{most:.4g} at most: the polar_inertia of link {i + 1} is of both axes together"
                    yield Problem("effects.rotary_inertia.radius_of_gyration", f"{own:g}", expected)

    @classmethod
    def tried_with(cls, scale: Scale) -> "RotaryInertia":
        return cls(radius_of_gyration=tuple(SLENDERNESS * link.length for link in scale.links))

    def section_gyration(self, link: int) -> Any:
        return per_joint(self.radius_of_gyration, link)

    def section_inertia(self, link: BentLink) -> tuple[Any, Any, Any]:
        """About z as given; about y what the polar inertia leaves, where the link has one."""
        about_z = link.mass * per_joint(self.radius_of_gyration, link.index) ** 2
        polar = link.table.polar_inertia
        about_y = 0.0 if polar is None else polar * link.table.length - about_z
        return 0.0, about_y, about_z
