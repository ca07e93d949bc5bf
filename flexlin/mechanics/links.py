"""One link of the chain: rigid, or bent along its assumed modes."""

from dataclasses import dataclass

import casadi as ca

from flexlin.checks import Array
from flexlin.mechanics.beam import ShapeIntegrals
from flexlin.mechanics.body import Moments, tensor
from flexlin.mechanics.frames import Frame, Z, column
from flexlin.scene.links import Link


@dataclass(frozen=True)
class Basis:
    """A link's assumed modes as numbers: integrals, roots beta (n,), and each mode's stiffness (n,) relative to EI / l^3."""

    integrals: ShapeIntegrals
    beta: Array
    stiffness: Array


@dataclass(frozen=True)
class BentLink:
    """A link whose axis is displaced by w(x, t) = sum X_k(x) w_k(t) across its frame's x-axis.

    Assumes small deflections of a slender beam; `w`, `w_rate` are (modes, 1) in m and m/s (X is dimensionless).
    The shape integrals are dimensionless numbers, so length, mass and stiffness may be symbols.
    """

    index: int
    table: Link
    basis: Basis
    base: Frame
    w: ca.SX
    w_rate: ca.SX

    @property
    def mass(self) -> ca.SX:
        """rho A l, in kg."""
        return self.table.mass_per_length * self.table.length

    @property
    def bends(self) -> bool:
        """Whether the link has any mode."""
        return self.table.modes > 0

    @property
    def bending_energy(self) -> ca.SX:
        """1/2 int EI w''^2 dx, in J."""
        if not self.bends:
            return ca.SX(0)
        stiffness = ca.SX(self.table.bending_stiffness) / self.table.length**3
        return stiffness / 2 * ca.bilin(ca.DM(self.basis.integrals.bending), self.w, self.w)

    @property
    def base_turn(self) -> tuple[ca.SX, ca.SX]:
        """The slope w'(0) of pinned shapes, with its rate: the hub turns by it beside the joint coordinate; zero when clamped."""
        if not self.table.pinned:
            return ca.SX(0), ca.SX(0)
        slope = ca.DM(self.basis.integrals.base_slope) / self.table.length
        return ca.dot(slope, self.w), ca.dot(slope, self.w_rate)

    def moments(self) -> Moments:
        """Moments of the bent link about its base frame, first order in w except where energy is of second order.

        first = int rhoA (x, w, 0),  second = int rhoA (r.r E - r r^T),  swirl = int rhoA (0, 0, x w'),  agitation = int rhoA w'^2.
        """
        k, m, length = self.basis.integrals, self.mass, self.table.length
        mode, gram = ca.DM(k.mode), ca.DM(k.gram)
        along, across = length**2 * k.second, ca.bilin(gram, self.w, self.w)
        mixed = m * length * ca.dot(ca.DM(k.mode_moment), self.w)
        return Moments(
            mass=m * k.mass,
            first=column(m * (length * k.first), m * ca.dot(mode, self.w), 0),
            first_rate=column(0, m * ca.dot(mode, self.w_rate), 0),
            second=tensor(xx=m * across, yy=m * along, zz=m * (along + across), xy=-mixed),
            swirl=column(0, 0, m * length * ca.dot(ca.DM(k.mode_moment), self.w_rate)),
            agitation=m * ca.bilin(gram, self.w_rate, self.w_rate),
        )

    def tip(self, shortening: ca.SX, shortening_rate: ca.SX) -> Frame:
        """The frame at the tip, turned by the slope w'(l); `shortening` is the tip's displacement along x (negative when bent)."""
        k, length = self.basis.integrals, self.table.length
        across, slope = ca.DM(k.tip), ca.DM(k.tip_slope) / length
        offset = column(length + shortening, ca.dot(across, self.w), 0)
        offset_rate = column(shortening_rate, ca.dot(across, self.w_rate), 0)
        return self.base.moved(offset, offset_rate).turned(Z, ca.dot(slope, self.w), ca.dot(slope, self.w_rate))
