"""Integrals of products of shapes of two kinds: of bending in y and in z, and of twist."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.beam.integrals import panels, remaining
from flexlin.mechanics.beam.profile import UNIFORM, Profile
from flexlin.mechanics.beam.shapes import Shapes


@dataclass(frozen=True)
class Couplings:
    """Products of shapes Y (bent in y), Z (bent in z) and Phi (twist), with psi the rotations of sections, dimensionless.

    across = int mu Y Z^T,   both_bent = 1/2 int (psi_y psi_z'^T - psi_y' psi_z^T)
    and of the twist with each of the two: tip = int (1 - xi) Phi psi'^T,   turn = 1/2 int (Phi' psi^T - Phi psi'^T),
    mass = int mu X2,   moment = int mu xi X2   with X2(xi) = int_0^xi (xi - s) Phi psi'^T ds
        and section = int eps Phi psi^T;   sections = int eps psi_y psi_z^T
    """

    across: Array
    both_bent: Array
    sections: Array
    y: "Twisted"
    z: "Twisted"


@dataclass(frozen=True)
class Twisted:
    """The products of twist with bending in one direction, each (twists, modes)."""

    tip: Array
    turn: Array
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
            turn=((slope * weight) @ turn[i].T - (phi * weight) @ curvature[i].T) / 2,
            mass=(phi * weight * levers[0]) @ curvature[i].T,
            moment=(phi * weight * levers[1]) @ curvature[i].T,
            section=(phi * weight * eps(xi)) @ turn[i].T,
        )

    return Couplings(
        across=(y.values(xi) * weight * mu(xi)) @ z.values(xi).T,
        both_bent=((turn[0] * weight) @ curvature[1].T - (curvature[0] * weight) @ turn[1].T) / 2,
        sections=(turn[0] * weight * eps(xi)) @ turn[1].T,
        y=twisted(0),
        z=twisted(1),
    )


def _outer_moments(mu: Profile, edges: Array, order: int) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """int_xi^1 mu s^k ds for k = 0, 1, and for k = 1, 2."""
    plain, first = remaining(mu, edges, order)
    second = remaining(Profile(lambda s: s * mu(s), mu.breaks), edges, order)[1]
    return (plain, first), (first, second)
