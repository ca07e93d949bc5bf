"""Integrals of products of shapes of two kinds: of bending in y and in z, and of twist."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.beam.integrals import UNIFORM, Profile, Shapes, panels, remaining


@dataclass(frozen=True)
class Couplings:
    """Products of shapes Y (bent in y), Z (bent in z) and Phi (twist), with psi the rotations of sections, dimensionless.

    across = int mu Y Z^T,   sections = int eps psi_y psi_z^T
    turn: 1/2 int (psi_y psi_z'^T - psi_y' psi_z^T), and 1/2 int (Phi' psi^T - Phi psi'^T) with psi_y and with psi_z
    turns: the same integrated over the sections, int eps (int_0^xi ... ds) dxi
    and of the twist with each of the two: tip = int (1 - xi) Phi psi'^T,
    mass = int mu X2,   moment = int mu xi X2   with X2(xi) = int_0^xi (xi - s) Phi psi'^T ds
        and section = int eps Phi psi^T
    """

    across: Array
    sections: Array
    turn: tuple[Array, Array, Array]
    turns: tuple[Array, Array, Array]
    y: "Twisted"
    z: "Twisted"


@dataclass(frozen=True)
class Twisted:
    """The products of twist with bending in one direction, each (twists, modes)."""

    tip: Array
    mass: Array
    moment: Array
    section: Array


def couple_shapes(
    y: Shapes, z: Shapes, twist: Shapes, mass_profile: Profile | None = None, stiffness_profile: Profile | None = None
) -> Couplings:
    """Integrate the products by Gauss-Legendre quadrature between all breaks; profiles as in `shape_integrals`."""
    mu, eps = mass_profile or UNIFORM, stiffness_profile or UNIFORM
    edges = np.unique([0.0, *y.breaks, *z.breaks, *twist.breaks, *mu.breaks, *eps.breaks, 1.0])
    order = max(shapes.order for shapes in (y, z, twist)) + 8
    xi, weight = panels(edges, order)
    turn = [shapes.rotation(xi) for shapes in (y, z)]
    curvature = [shapes.rotation(xi, 1) for shapes in (y, z)]
    phi, slope = twist.rotation(xi), twist.rotation(xi, 1)
    levers = [beyond - xi * before for before, beyond in zip(*_outer_moments(mu, edges, order), strict=True)]

    def twisted(i: int) -> Twisted:
        return Twisted(
            tip=(phi * weight * (1 - xi)) @ curvature[i].T,
            mass=(phi * weight * levers[0]) @ curvature[i].T,
            moment=(phi * weight * levers[1]) @ curvature[i].T,
            section=(phi * weight * eps(xi)) @ turn[i].T,
        )

    def turned(weight: Array) -> tuple[Array, Array, Array]:
        pairs = ((turn[0], curvature[0], turn[1], curvature[1]), *((phi, slope, turn[i], curvature[i]) for i in (0, 1)))
        x, by_y, by_z = (((a * weight) @ db.T - (da * weight) @ b.T) / 2 for a, da, b, db in pairs)
        return x, -by_y, -by_z

    return Couplings(
        across=(y.values(xi) * weight * mu(xi)) @ z.values(xi).T,
        sections=(turn[0] * weight * eps(xi)) @ turn[1].T,
        turn=turned(weight),
        turns=turned(weight * remaining(eps, edges, order)[0]),
        y=twisted(0),
        z=twisted(1),
    )


def _outer_moments(mu: Profile, edges: Array, order: int) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """int_xi^1 mu s^k ds for k = 0, 1, and for k = 1, 2."""
    plain, first = remaining(mu, edges, order)
    second = remaining(Profile(lambda s: s * mu(s), mu.breaks), edges, order)[1]
    return (plain, first), (first, second)
