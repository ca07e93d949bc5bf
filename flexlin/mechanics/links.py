"""One link of the chain: rigid, or bent in y, bent in z and twisted along its assumed modes."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import add
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.beam.integrals import Couplings, ShapeIntegrals
from flexlin.mechanics.body import Frame, Moments, column, tensor
from flexlin.scene.links import DIRECTIONS, Direction, Link

PLACES = np.arange(17) / 16
"""Places x/l of a link's axis that pictures show."""
COLUMNS = len(PLACES) + 1
"""Columns for each link in pictures: where the link before it ends, and the places of its axis."""


@dataclass(frozen=True)
class Basis:
    """A link's assumed modes as numbers.

    integrals; roots beta (n,); each mode's stiffness (n,) relative to EI / l^3 or GJ / l; the shapes at PLACES, (n, places).
    """

    integrals: ShapeIntegrals
    beta: Array
    stiffness: Array
    axis: Array


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
        return self.strain(self.w)

    def strain(self, w: ca.SX) -> ca.SX:
        """The same of other coordinates, such as the rates in the place of w."""
        return self.rigidity / 2 * ca.bilin(ca.DM(self.integrals.bending), w, w)

    def inertia_form(self) -> ca.SX:
        """int rhoA w'^2 dx, or int rhoI_p phi'^2 dx, in J."""
        if self.direction == "torsion":
            spin = ca.bilin(ca.DM(self.integrals.rotations), self.w_rate, self.w_rate)
            return ca.SX(self.table.polar_inertia) * self.table.length * spin
        moved = ca.bilin(ca.DM(self.integrals.gram), self.w_rate, self.w_rate)
        return self.table.mass_per_length * self.table.length * moved

    def linear(self, factors: Array, over: Any = 1) -> tuple[Any, Any]:
        """factors . w / over, and its rate: plain zeros, which cost nothing, where nothing deflects; `over` may be a symbol."""
        if not self.n:
            return 0.0, 0.0
        row = ca.DM(factors) / over
        return ca.dot(row, self.w), ca.dot(row, self.w_rate)

    def square(self, form: Array) -> Any:
        """w . form w."""
        return ca.bilin(ca.DM(form), self.w, self.w) if self.n else 0.0

    def quadratic(self, form: Array, over: Any = 1) -> tuple[ca.SX, ca.SX]:
        """1/2 w . form w / over of a symmetric form, and its rate."""
        matrix = ca.DM(form) / over
        return ca.bilin(matrix, self.w, self.w) / 2, ca.bilin(matrix, self.w, self.w_rate)


def product(form: Array, a: Deflection, b: Deflection) -> tuple[Any, Any]:
    """a . form b of two deflections, and its rate."""
    if not a.n or not b.n:
        return 0.0, 0.0
    matrix = ca.DM(form)
    return ca.bilin(matrix, a.w, b.w), ca.bilin(matrix, a.w_rate, b.w) + ca.bilin(matrix, a.w, b.w_rate)


@dataclass(frozen=True)
class LinkBasis:
    """The assumed modes of a link as numbers: of each direction, and their products; `couplings` is None where there are none."""

    y: Basis
    z: Basis
    torsion: Basis
    couplings: Couplings | None = None


@dataclass(frozen=True, eq=False)
class BentLink:
    """A link whose axis is displaced by v(x, t) along y and by w(x, t) along z of its frame, and whose sections turn by phi(x, t).

    Assumes small deflections of a slender beam. The shape integrals are dimensionless numbers, so length, mass and stiffness may be
    symbols. `coupled`: twist turns the planes of bending.
    """

    index: int
    table: Link
    base: Frame
    y: Deflection
    z: Deflection
    torsion: Deflection
    couplings: Couplings | None = None
    coupled: bool = False

    @classmethod
    def of(
        cls, index: int, table: Link, basis: LinkBasis, base: Frame, w: ca.SX, w_rate: ca.SX, coupled: bool = False
    ) -> "BentLink":
        """Deal the link's elastic coordinates out: those of bending in y first, then in z, then of twist."""
        counts = [getattr(table.counts, direction) for direction in DIRECTIONS]
        ends = [sum(counts[:k]) for k in range(len(counts) + 1)]
        y, z, torsion = (
            Deflection(direction, table, getattr(basis, direction), w[a:b], w_rate[a:b])
            for direction, a, b in zip(DIRECTIONS, ends[:-1], ends[1:], strict=True)
        )
        return cls(index, table, base, y, z, torsion, basis.couplings, coupled)

    @property
    def mass(self) -> ca.SX:
        """rho A l, in kg."""
        return self.table.mass_per_length * self.table.length

    @property
    def bending(self) -> tuple[Deflection, ...]:
        """The directions in which the link bends."""
        return tuple(part for part in (self.y, self.z) if part.n)

    @property
    def deflections(self) -> tuple[Deflection, ...]:
        """All that is elastic in the link."""
        return tuple(part for part in (self.y, self.z, self.torsion) if part.n)

    @property
    def elastic_energy(self) -> ca.SX:
        """1/2 int (EI_z v''^2 + EI_y w''^2 + GJ phi'^2) dx, in J."""
        return sum((part.energy for part in self.deflections), ca.SX(0))

    @property
    def base_turn(self) -> tuple[Any, Any]:
        """The slope v'(0) of pinned shapes, with its rate: the hub turns by it beside the joint coordinate; zero when clamped."""
        if not self.table.pinned:
            return 0.0, 0.0
        return self.y.linear(self.y.integrals.base_slope, self.table.length)

    def moments(self) -> Moments:
        """Moments of the bent link about its base frame, first order in v, w, phi except where energy is of second order.

        first = int rhoA (x, v, w),  second = int rhoA (r.r E - r r^T),  swirl = int rhoA (v w' - w v', -x w', x v'),
        agitation = int rhoA (v'^2 + w'^2). The sections' own inertia is not in them.
        """
        k, m, length = self.y.integrals, self.mass, self.table.length
        (v, v_rate), (w, w_rate) = (part.linear(part.integrals.mode) for part in (self.y, self.z))
        (mv, mv_rate), (mw, mw_rate) = (part.linear(part.integrals.mode_moment) for part in (self.y, self.z))
        along = length**2 * k.second
        vv, ww = (part.square(part.integrals.gram) for part in (self.y, self.z))
        vw, whirl = self._cross_products()
        spread = tensor(
            xx=m * (vv + ww),
            yy=m * (along + ww),
            zz=m * (along + vv),
            xy=-m * length * mv,
            xz=-m * length * mw,
            yz=-m * vw,
        )
        return Moments(
            mass=m * k.mass,
            first=column(m * (length * k.first), m * v, m * w),
            first_rate=column(0, m * v_rate, m * w_rate),
            second=spread,
            swirl=column(m * whirl, -m * length * mw_rate, m * length * mv_rate),
            agitation=sum((part.inertia_form() for part in self.bending), ca.SX(0)),
        )

    def _cross_products(self) -> tuple[Any, Any]:
        """int mu v w and int mu (v w' - w v'), dimensionless in x."""
        if self.couplings is None:
            return 0.0, 0.0
        form, y, z = ca.DM(self.couplings.across), self.y, self.z
        whirl = ca.bilin(form, y.w, z.w_rate) - ca.bilin(form, y.w_rate, z.w)
        return product(self.couplings.across, y, z)[0], whirl

    def axis(self) -> ca.SX:
        """Points on the bent axis at PLACES in world axes, (3, 17), in m: r_0 + R (x, v, w)."""
        v, w = (part.w.T @ ca.DM(part.basis.axis) if part.n else ca.SX(1, len(PLACES)) for part in (self.y, self.z))
        offsets = ca.vertcat(self.table.length * ca.DM(PLACES).T, v, w)
        return ca.repmat(self.base.position, 1, len(PLACES)) + self.base.rotation @ offsets

    def second_turns(self, forms: Sequence[Array]) -> tuple[list[Any], list[Any]]:
        """theta2 = 1/2 int theta x theta' dx about x, y and z, and its rate, by the forms of `Couplings`."""
        length, pairs = self.table.length, ((self.y, self.z), (self.torsion, self.y), (self.torsion, self.z))
        sizes = (1 / length**2, 1 / length, 1 / length)
        about = [product(form, *pair) for form, pair in zip(forms, pairs, strict=True)]
        values, rates = ([size * part[i] for size, part in zip(sizes, about, strict=True)] for i in (0, 1))
        return values, rates

    def turns(self) -> tuple[ca.SX, ca.SX]:
        """First order of the tip's rotation (phi, -w', v')(l), (3, 1), and its rate."""
        length = self.table.length
        phi, phi_rate = self.torsion.linear(self.torsion.integrals.tip_slope)
        down, down_rate = self.z.linear(self.z.integrals.tip_slope, -length)
        up, up_rate = self.y.linear(self.y.integrals.tip_slope, length)
        return column(phi, down, up), column(phi_rate, down_rate, up_rate)

    def tip(self, shift: ca.SX, shift_rate: ca.SX, turn: ca.SX, turn_rate: ca.SX) -> Frame:
        """The frame at the tip; `shift` and `turn` (3, 1) are what effects add to displacement and rotation.

        The rotation exp(theta~) is Rz(a) Ry(b) Rx(c) with a, b, c = theta and products that make it so to second order.
        """
        (v, v_rate), (w, w_rate) = (part.linear(part.integrals.tip) for part in (self.y, self.z))
        theta, theta_rate = (a + b for a, b in zip(self.turns(), (turn, turn_rate), strict=True))
        angles, rates = split_rotation(theta, theta_rate)
        frame = self.base.moved(column(self.table.length, v, w) + shift, column(0, v_rate, w_rate) + shift_rate)
        return frame.turned_by(angles, rates)


def split_rotation(theta: ca.SX, rate: ca.SX) -> tuple[tuple[ca.SX, ...], tuple[ca.SX, ...]]:
    """Angles a, b, c with Rz(a) Ry(b) Rx(c) = exp(theta~) to second order, and their rates.

    a = theta_z + theta_x theta_y / 2,   b = theta_y - theta_x theta_z / 2,   c = theta_x + theta_y theta_z / 2
    """
    (x, y, z), (dx, dy, dz) = (ca.vertsplit(part) for part in (theta, rate))
    if theta.nnz() < 2:  # about one axis
        return (z, y, x), (dz, dy, dx)
    angles = (z + x * y / 2, y - x * z / 2, x + y * z / 2)
    rates = (dz + (dx * y + x * dy) / 2, dy - (dx * z + x * dz) / 2, dx + (dy * z + y * dz) / 2)
    return angles, rates


def turned_sections(link: BentLink, J: tuple[Any, Any, Any]) -> Moments:
    """Moments of sections with principal inertias J about x, y, z (kg m^2 for the whole link), turned by theta = (phi, -w', v').

        second = int R J R^T,   swirl = int J theta' + theta x J theta' - 1/2 J (theta x theta'),   agitation = int theta'.J theta'
        R = E + theta~ + 1/2 theta~^2

    kept to second order; where twist turns the planes of bending, theta2 = 1/2 int theta x theta' dx is added to theta. Assumes that mass
    and stiffness of sections vary alike. Returns: moments about the link's base frame.
    """
    first, rate = zip(*(part.linear(part.integrals.rotation, over) for part, over in rotations(link)), strict=True)
    if link.coupled and link.couplings is not None:
        more = link.second_turns(link.couplings.turns)
        first, rate = (tuple(map(add, *pair)) for pair in zip((first, rate), more, strict=True))
    cycles = (0, 1, 2), (1, 2, 0), (2, 0, 1)
    along, across, swirl, agitation = list[Any](), list[Any](), list[Any](), ca.SX(0)
    for (a, b, c), turn, turn_rate in zip(cycles, first, rate, strict=True):
        bb, cc, bc = (mixed(link, i, j, rates=0) for i, j in ((b, b), (c, c), (b, c)))
        along.append(J[a] * link.y.integrals.section + (J[b] - J[a]) * cc + (J[c] - J[a]) * bb)
        across.append((J[b] - J[c]) * turn + ((J[b] + J[c]) / 2 - J[a]) * bc)
        whirl = (J[c] - J[a] / 2) * mixed(link, b, c, rates=1) - (J[b] - J[a] / 2) * mixed(link, c, b, rates=1)
        swirl.append(J[a] * turn_rate + whirl)
        agitation += J[a] * mixed(link, a, a, rates=2)
    (xx, yy, zz), (yz, zx, xy) = along, across
    return Moments(second=tensor(xx, yy, zz, xy, zx, yz), swirl=column(*swirl), agitation=agitation)


def rotations(link: BentLink) -> tuple[tuple[Deflection, Any], ...]:
    """What turns a section about x, y and z, and what the turn of a unit of its coordinate is divided by."""
    length = link.table.length
    return (link.torsion, 1.0), (link.z, -length), (link.y, length)


def mixed(link: BentLink, a: int, b: int, rates: int) -> Any:
    """int theta_a theta_b, with the rate of the second, or of both, in its place."""
    (one, over), (other, under) = rotations(link)[a], rotations(link)[b]
    if not one.n or not other.n:
        return 0.0
    left, right = one.w_rate if rates == 2 else one.w, other.w_rate if rates else other.w
    return ca.bilin(ca.DM(section_form(link, a, b)) / (over * under), left, right)


def section_form(link: BentLink, a: int, b: int) -> Array:
    """int eps psi_a psi_b^T of the sections' rotations about two axes."""
    if a == b:
        return rotations(link)[a][0].integrals.rotations
    if a > b:
        return section_form(link, b, a).T
    k = link.couplings
    assert k is not None  # two directions deflect
    return {(0, 1): k.section[1], (0, 2): k.section[0], (1, 2): k.sections.T}[a, b]
