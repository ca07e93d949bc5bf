"""A link's axis at any deflection: a curve, mostly inextensible, written as the rotations of its sections at a few places.

The shapes are slopes. With theta = (phi, -w', v'), linear in the elastic coordinates, the section at x is turned by Rz(a) Ry(b) Rx(c), to
second order exp(theta~), and the axis follows Rz(a) Ry(b) e_x, its normal where nothing shears. The energy of bending is that of the exact
curvatures, 1/2 int EI_z (a' cos b)^2 + EI_y b'^2 dx; in a plane it is quadratic. The kinetic energy is that of the axis' velocity and of
the sections' angular velocity, squares integrated by a rule with positive weights, so M(s) is positive definite however far the link
bends. To second order the axis is that of `geometric_stiffening` and, where twist turns the curvatures,

    a' = v'' - phi w'',   b' = -(w'' + phi v''),   c' = phi' - w' v'',

that of `bending_torsion_coupling`; without that effect twist leaves the axis alone. That effect alone, which leaves out the shortening,
has the axis follow (1, a, -b) and the energy of bending of second order.

Source: Reissner, J. Applied Mathematics and Physics 23 (1972) 795; Hodges, Dowell, NASA TN D-7818 (1974), section 3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.mechanics.beam.integrals import Profile, Shapes, gauss_legendre, panels
from flexlin.mechanics.body import Body, Frame, InertiaForm, Moments, column, tensor
from flexlin.mechanics.links import PLACES, BentLink, rotations, split_rotation

MOST_NODES = 40
"""Most Gauss nodes of a rule between two breaks."""


@dataclass(frozen=True)
class CurveRule:
    """What the curve needs of a link's shapes as numbers, at m places x/l.

    weight, load, section (m,): of integrals from 0 to 1 of a function, of it times the relative mass, times the relative second moment of
    area; within (p, m / p, m / p): of the integrals to each place of a piece between breaks from where the piece begins; drawn (17, m): of
    the integrals from 0 to PLACES; slopes, turns: theta of the axis and of the
    sections about x, y (there -theta) and z, bends: theta_z' of the sections, (m, n) each, for a unit of the coordinates; twists: what
    twist adds about x, y and z, int theta_y theta_z' dx, -int theta_x theta_z' dx, int theta_x theta_y' dx, at the places and the tip,
    for a unit of the products of coordinates, (m + 1, n n') each.
    """

    weight: Array
    load: Array
    section: Array
    within: Array
    drawn: Array
    slopes: tuple[Array, Array, Array]
    turns: tuple[Array, Array, Array]
    bends: Array
    twists: tuple[Array, Array, Array]


def make_rule(y: Shapes, z: Shapes, twist: Shapes, mu: Profile, eps: Profile) -> CurveRule:
    """The rule for shapes in y, in z and of twist: 2 n + 6 Gauss nodes, dealt out to the pieces between breaks, at least 3 to each.

    Products of two deflections or slopes of n modes of a uniform beam are integrated to 3e-9 and better; others get what that takes.
    """
    shapes = twist, z, y
    edges = np.unique([0.0, *(place for part in (*shapes, mu, eps) for place in part.breaks), 1.0])
    least = max(-(-(2 * max(part.n for part in shapes) + 6) // (len(edges) - 1)), 3)

    def integrals(order: int) -> list[Array]:
        return [found for part in shapes for found in integrate_products(part, edges, order)]

    order, exact = least, integrals(MOST_NODES)
    while order < MOST_NODES and any(
        np.abs(found - known).max(initial=0.0) > 1e-8 * np.abs(known).max(initial=0.0)
        for found, known in zip(integrals(order), exact, strict=True)
    ):
        order += 1
    xi, weight = panels(edges, order)
    upto = partial(integrate_to, edges, order)
    turns, bends = (tuple(part.rotation(xi, k).T for part in shapes) for k in (0, 1))
    slopes = (turns[0], z.values(xi, 1).T, y.values(xi, 1).T)
    loads, far = (weight * mu(xi), weight * eps(xi)), upto(np.append(xi, 1.0))
    pairs = (turns[1], bends[2]), (turns[0], bends[2]), (turns[0], bends[1])
    twists = tuple(-far @ np.einsum("ma,mb->mab", a, b).reshape(len(xi), -1) for a, b in pairs)
    inside = [far[part, part] for part in (slice(k, k + order) for k in range(0, len(xi), order))]
    return CurveRule(weight, *loads, np.array(inside), upto(PLACES), slopes, turns, bends[2], twists)  # type: ignore[arg-type]


def integrate_products(shapes: Shapes, edges: Array, order: int) -> list[Array]:
    """Of deflections, of slopes and of sections' rotations: integrals of products of two, and of one, (n + 1, n), by a rule of `panels`."""
    xi, weight = panels(edges, order)
    kinds = shapes.values(xi), shapes.values(xi, 1), shapes.rotation(xi)
    return [np.concatenate([kind, np.ones((1, len(xi)))]) @ (kind * weight).T for kind in kinds]


def integrate_to(edges: Array, order: int, ends: Array) -> Array:
    """The weights (N, m) of values at the nodes of `panels` in the integrals from 0 to `ends` (N,).

    On each piece the polynomial through the nodes is integrated, sum_k (k + 1/2) w_j P_k(x_j) int P_k dx.
    """
    nodes, weights = gauss_legendre(order)
    expansion = legendre.legvander(nodes, order - 1).T * weights * (np.arange(order)[:, None] + 0.5)
    found = []
    for a, b in pairwise(edges):
        x = np.clip(2 * (ends - a) / (b - a) - 1, -1.0, 1.0)
        primitives = np.stack([legendre.legval(x, legendre.legint(row, lbnd=-1)) for row in np.eye(order)], axis=1)
        found.append(primitives @ expansion * (b - a) / 2)
    return np.concatenate(found, axis=1)


@dataclass(frozen=True, eq=False)
class CurvedLink(BentLink):
    """A link whose axis is a curve, looked at by a rule: inextensible where it is `shortened`, else each x stays where it was."""

    rule: CurveRule = field(kw_only=True)
    shortened: bool = field(kw_only=True)

    def vectors(self, forms: Sequence[Array]) -> tuple[ca.SX, ca.SX]:
        """Rotation vectors (3, places) from what a unit of the coordinates makes of them about x, y and z, and their rates."""
        return stack_rows(forms, [(part.w, part.w_rate, over) for part, over in rotations(self)])

    @lazy
    def twisting(self) -> tuple[ca.SX, ca.SX]:
        """What twist adds to c, b and a at the places and the tip, (3, m + 1), and its rate; nothing where twist leaves the axis."""
        length, x, y, z = self.table.length, self.torsion, self.z, self.y
        pairs = (y, z, length**2), (x, z, length), (x, y, length)
        forms = self.rule.twists if self.coupled else [form[:, :0] for form in self.rule.twists]
        products = [(ca.kron(a.w, b.w), ca.kron(a.w_rate, b.w) + ca.kron(a.w, b.w_rate), over) for a, b, over in pairs]
        return stack_rows(forms, products)

    @lazy
    def angles(self) -> tuple[tuple[ca.SX, ca.SX], ...]:
        """a = v' - int phi w'' dx and b = -w' - int phi v'' dx of the axis at the places; without the integrals where twist leaves it."""
        slopes = self.vectors(self.rule.slopes)[0] + self.twisting[0][:, :-1]
        return tuple((ca.sparsify(slopes[2, k]), ca.sparsify(slopes[1, k])) for k in range(slopes.size2()))

    @property
    def elastic_energy(self) -> ca.SX:
        """1/2 int (EI_z (a' cos b)^2 + EI_y b'^2 + GJ phi'^2) dx, in J."""
        if len(self.bending) < 2 or not self.shortened:
            return super().elastic_energy
        sines = ca.vertcat(*[ca.sin(b) for _, b in self.angles])
        less = ca.dot(ca.DM(self.rule.section), (sines * (ca.DM(self.rule.bends) @ self.y.w)) ** 2)
        return super().elastic_energy - self.y.rigidity * less / 2

    @lazy
    def directions(self) -> ca.SX:
        """The direction of the axis at the places in world axes, (3, m)."""
        return self.directions_in(self.base)

    def directions_in(self, frame: Frame) -> ca.SX:
        """The directions Rz(a) Ry(b) e_x of the axis at the places, without shortening (1, a, -b), from a frame's axes to the world's."""
        if not self.shortened:
            return ca.sparsify(frame.rotation @ ca.horzcat(*[column(1, a, -b) for a, b in self.angles]))
        return ca.horzcat(*[frame.facing(a, b) for a, b in self.angles])

    def places(self, rule: Array) -> ca.SX:
        """Points on the bent axis in world axes, (3, N), by the weights (N, m) of the integrals up to them."""
        begins = ca.repmat(self.base.position, 1, len(rule))
        return ca.sparsify(begins + self.directions @ (self.table.length * ca.DM(rule.T)))

    def axis(self) -> ca.SX:
        """Points on the bent axis at PLACES in world axes, (3, 17), in m."""
        return self.places(self.rule.drawn)

    def inertia(self) -> list[InertiaForm]:
        """The mass of the axis piece by piece, r(x_j) = r_begin + l sum_k within_jk e_k with the directions e_k of the piece.

        Pieces of the whole link would have m^2 numbers in the form of all its m places, which of finite elements are many.
        """
        forms, begin, order = [], self.base.position, self.rule.within.shape[1]
        for k, within in enumerate(self.rule.within):
            part = slice(k * order, (k + 1) * order)
            directions, load = self.directions[:, part], ca.DM(np.diag(self.rule.load[part]))
            reach = ca.horzcat(ca.SX.ones(order), self.table.length * ca.DM(within))
            forms.append(InertiaForm(ca.horzcat(begin, directions), self.mass * (reach.T @ (load @ reach))))
            begin = begin + directions @ (self.table.length * ca.DM(self.rule.weight[part]))
        return forms

    def moments(self) -> Moments:
        """Its axis has a form of its own."""
        return Moments()

    def split(self, theta: ca.SX, rate: ca.SX, k: int) -> tuple[tuple[ca.SX, ...], tuple[ca.SX, ...]]:
        """Angles a, b, c of the section at place k that turns by theta (3, 1) beside what twist adds, and their rates."""
        if not self.coupled:
            return split_rotation(theta, rate)
        more, more_rate = (part[:, k] for part in self.twisting)
        a, b = (tuple(ca.vertsplit(part)[::-1]) for part in (theta + more, rate + more_rate))
        return a, b

    @property
    def in_plane(self) -> bool:
        """Whether it turns and bends about z alone: the moments of its sections are then exact at any deflection."""
        return not (self.z.n or self.torsion.n or self.base.spin[:2].nnz())

    def sections(self, J: tuple[Any, Any, Any]) -> list[Body]:
        """The sections at the places as bodies that turn, with principal inertias J about x, y, z (kg m^2 for the whole link)."""
        theta, rate = self.vectors(self.rule.turns)
        angles = [self.split(theta[:, k], rate[:, k], k) for k in range(theta.size2())]
        frames = [self.base.turned_by(*pair) for pair in angles]
        shares = [tensor(*(share * each for each in J)) for share in self.rule.section.tolist()]
        return [Body(frame, Moments(second=share)) for frame, share in zip(frames, shares, strict=True)]

    def tip(self, shift: ca.SX, shift_rate: ca.SX, turn: ca.SX, turn_rate: ca.SX) -> Frame:
        """The frame at the tip; `shift` and `turn` (3, 1) are what effects add to displacement and rotation."""
        offset = ca.sparsify(self.table.length * self.directions_in(Frame.fixed()) @ ca.DM(self.rule.weight))
        parts, (theta, theta_rate) = (self.y, self.z, self.torsion), self.turns()
        w, w_rate = ca.vertcat(*[part.w for part in parts]), ca.vertcat(*[part.w_rate for part in parts])
        angles = self.split(theta + turn, theta_rate + turn_rate, -1)
        frame = self.base.moved(offset + shift, ca.sparsify(ca.jtimes(offset, w, w_rate)) + shift_rate)
        if not shift.nnz():
            frame = replace(frame, position=self.places(self.rule.weight[None]))
        return frame.turned_by(*angles)


def stack_rows(forms: Sequence[Array], parts: Sequence[tuple[ca.SX, ca.SX, Any]]) -> tuple[ca.SX, ca.SX]:
    """The rows (form w / over)^T one below the other, empty where there is no w, and the same of their rates; parts: w, w', over."""

    def row(form: Array, w: ca.SX, over: Any) -> ca.SX:
        return (ca.DM(form) @ w / over).T if form.shape[1] and w.numel() else ca.SX(1, len(form))

    rows = [(row(form, w, over), row(form, rate, over)) for form, (w, rate, over) in zip(forms, parts, strict=True)]
    values, rates = (ca.sparsify(ca.vertcat(*part)) for part in zip(*rows, strict=True))
    return values, rates
