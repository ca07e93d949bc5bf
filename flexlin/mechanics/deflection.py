"""What a link's elastic coordinates of one kind are: bending in y, bending in z, or twist."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.beam import ShapeIntegrals
from flexlin.scene.links import Direction, Link

PLACES = np.linspace(0.0, 1.0, 17)
"""Places x/l of a link's axis that pictures show."""


@dataclass(frozen=True)
class Basis:
    """A link's assumed modes as numbers.

    integrals; roots beta (n,); each mode's stiffness (n,) relative to EI / l^3 or GJ / l; the shapes at PLACES, (n, places).
    """

    integrals: ShapeIntegrals
    beta: Array
    stiffness: Array
    axis: Array

    def without_modes(self) -> "Basis":
        """The same link where it does not deflect."""
        return Basis(self.integrals.without_modes(), self.beta[:0], self.stiffness[:0], self.axis[:0])


@dataclass(frozen=True, eq=False)
class Deflection:
    """The deflection of a link in one direction, sum X_k(x) w_k(t).

    `w`, `w_rate` (modes, 1) are in m and m/s for bending, in rad and rad/s for twist. Link's figures may be symbols.
    """

    direction: Direction
    table: Link
    basis: Basis
    w: ca.SX
    w_rate: ca.SX

    @property
    def integrals(self) -> ShapeIntegrals:
        """The integrals of the shapes."""
        return self.basis.integrals

    @property
    def n(self) -> int:
        """The number of modes."""
        return int(self.w.numel())

    @property
    def rigidity(self) -> ca.SX:
        """The factor of the modes' stiffness: EI / l^3, or GJ / l for twist."""
        power = 1 if self.direction == "torsion" else 3
        return ca.SX(self.table.stiffness_in(self.direction)) / self.table.length**power

    @property
    def resistance(self) -> ca.SX:
        """The factor of a mode's 2 omega m that its stiffness / beta^2 leaves: sqrt(rhoA EI) / l, or sqrt(rhoI_p GJ) for twist."""
        if self.direction == "torsion":
            return ca.sqrt(ca.SX(self.table.polar_inertia) * self.table.torsional_stiffness)
        return ca.sqrt(ca.SX(self.table.mass_per_length) * self.table.stiffness_in(self.direction)) / self.table.length

    @property
    def energy(self) -> ca.SX:
        """1/2 int EI w''^2 dx, or 1/2 int GJ phi'^2 dx, in J."""
        return self.rigidity / 2 * ca.bilin(ca.DM(self.integrals.bending), self.w, self.w)

    def inertia_form(self) -> ca.SX:
        """int rhoA w'^2 dx, or int rhoI_p phi'^2 dx, in J."""
        if self.direction == "torsion":
            spin = ca.bilin(ca.DM(self.integrals.rotations), self.w_rate, self.w_rate)
            return ca.SX(self.table.polar_inertia) * self.table.length * spin
        return (
            self.table.mass_per_length
            * self.table.length
            * ca.bilin(ca.DM(self.integrals.gram), self.w_rate, self.w_rate)
        )

    def linear(self, factors: Array, over: Any = None) -> tuple[Any, Any]:
        """factors . w / over, and its rate: plain zeros, which cost nothing, where nothing deflects; `over` may be a symbol."""
        if not self.n:
            return 0.0, 0.0
        row = divide(factors, over)
        return ca.dot(row, self.w), ca.dot(row, self.w_rate)

    def square(self, form: Array) -> Any:
        """w . form w."""
        return ca.bilin(ca.DM(form), self.w, self.w) if self.n else 0.0

    def quadratic(self, form: Array, over: Any = None) -> tuple[ca.SX, ca.SX]:
        """1/2 w . form w / over of a symmetric form, and its rate."""
        matrix = divide(form, over)
        return ca.bilin(matrix, self.w, self.w) / 2, ca.bilin(matrix, self.w, self.w_rate)


def divide(numbers: Array, over: Any) -> ca.DM | ca.SX:
    """An array for CasADi, divided by a number or a symbol if there is one."""
    return ca.DM(numbers) if over is None else ca.DM(numbers) / over


def product(form: Array, a: Deflection, b: Deflection) -> tuple[Any, Any]:
    """a . form b of two deflections, and its rate."""
    if not a.n or not b.n:
        return 0.0, 0.0
    matrix = ca.DM(form)
    return ca.bilin(matrix, a.w, b.w), ca.bilin(matrix, a.w_rate, b.w) + ca.bilin(matrix, a.w, b.w_rate)
