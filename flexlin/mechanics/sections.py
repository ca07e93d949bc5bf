"""The inertia of a link's sections, which turn with its axis and with its twist."""

from itertools import product as pairs
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.mechanics.body import Moments
from flexlin.mechanics.deflection import Deflection
from flexlin.mechanics.links import BentLink

EPSILON = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    EPSILON[_i, _j, _k], EPSILON[_j, _i, _k] = 1.0, -1.0


def turned_sections(link: BentLink, J: tuple[Any, Any, Any]) -> Moments:
    """Moments of sections with principal inertias J about x, y, z (kg m^2 for the whole link), turned by theta = (phi, -w', v').

        second = int R J R^T,   swirl = int J theta' + theta x J theta' - 1/2 J (theta x theta'),   agitation = int theta'.J theta'
        R = E + theta~ + 1/2 theta~^2

    kept to second order. Assumes that mass and stiffness of sections vary alike, and leaves out what `bending_torsion_coupling` adds
    to R. Returns: moments about the link's base frame.
    """
    first, rate = tilt(link)
    second, swirl = ca.SX(3, 3), ca.SX(3, 1)
    for a in range(3):
        second[a, a] += J[a] * link.y.integrals.section
        swirl[a] += J[a] * rate[a]
    for a, b, p in pairs(range(3), repeat=3):
        if EPSILON[a, p, b]:
            second[a, b] += EPSILON[a, p, b] * (J[b] - J[a]) * first[p]
    agitation = ca.SX(0)
    if link.deflections:
        second += spread(link, J)
        for a, b, c in pairs(range(3), repeat=3):
            if EPSILON[a, b, c]:
                swirl[a] += EPSILON[a, b, c] * (J[c] - J[a] / 2) * mixed(link, b, c, rates=1)
        agitation = sum((J[a] * mixed(link, a, a, rates=2) for a in range(3)), ca.SX(0))
    return Moments(second=ca.sparsify(second), swirl=ca.sparsify(swirl), agitation=agitation)


def spread(link: BentLink, J: tuple[Any, Any, Any]) -> ca.SX:
    """int theta~ J theta~^T + 1/2 (theta~^2 J + J theta~^2), (3, 3)."""
    G = [[mixed(link, a, b, rates=0) for b in range(3)] for a in range(3)]
    found = ca.SX(3, 3)
    for a, b in pairs(range(3), repeat=2):
        square = G[a][b] - (sum((G[p][p] for p in range(3)), ca.SX(0)) if a == b else 0)
        found[a, b] = square * (J[a] + J[b]) / 2
        for c, p, q in pairs(range(3), repeat=3):
            factor = EPSILON[a, p, c] * EPSILON[b, q, c]
            if factor:
                found[a, b] += factor * J[c] * G[p][q]
    return found


def rotations(link: BentLink) -> tuple[tuple[Deflection, Any], ...]:
    """What turns a section about x, y and z, and by how much a unit of its coordinate does."""
    length = ca.SX(link.table.length)
    return (link.torsion, ca.SX(1)), (link.z, -1 / length), (link.y, 1 / length)


def tilt(link: BentLink) -> tuple[list[ca.SX], list[ca.SX]]:
    """int theta and int theta', relative to the link's length."""
    if not link.deflections:
        return [ca.SX(0)] * 3, [ca.SX(0)] * 3
    values = [tuple(size * x for x in part.linear(part.integrals.rotation)) for part, size in rotations(link)]
    return [value for value, _ in values], [rate for _, rate in values]


def mixed(link: BentLink, a: int, b: int, rates: int) -> ca.SX:
    """int theta_a theta_b, with the rate of the second, or of both, in its place."""
    (one, size), (other, factor) = rotations(link)[a], rotations(link)[b]
    if not one.n or not other.n:
        return ca.SX(0)
    left, right = one.w_rate if rates == 2 else one.w, other.w_rate if rates else other.w
    return size * factor * ca.bilin(ca.DM(section_form(link, a, b)), left, right)


def section_form(link: BentLink, a: int, b: int) -> Array:
    """int eps psi_a psi_b^T of the sections' rotations about two axes."""
    if a == b:
        return rotations(link)[a][0].integrals.rotations
    if a > b:
        return section_form(link, b, a).T
    k = link.couplings
    assert k is not None  # two directions deflect
    return {(0, 1): k.z.section, (0, 2): k.y.section, (1, 2): k.sections.T}[a, b]
