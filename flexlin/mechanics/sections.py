"""The inertia of a link's sections, which turn with its axis and with its twist."""

from itertools import product as pairs
from typing import Any

import casadi as ca

from flexlin.checks import Array
from flexlin.mechanics.body import Moments, tensor
from flexlin.mechanics.deflection import Deflection
from flexlin.mechanics.frames import column
from flexlin.mechanics.links import BentLink

SIGNS = {(0, 1, 2): 1.0, (1, 2, 0): 1.0, (2, 0, 1): 1.0, (1, 0, 2): -1.0, (2, 1, 0): -1.0, (0, 2, 1): -1.0}
"""The permutation symbol where it is not zero."""


def turned_sections(link: BentLink, J: tuple[Any, Any, Any]) -> Moments:
    """Moments of sections with principal inertias J about x, y, z (kg m^2 for the whole link), turned by theta = (phi, -w', v').

        second = int R J R^T,   swirl = int J theta' + theta x J theta' - 1/2 J (theta x theta'),   agitation = int theta'.J theta'
        R = E + theta~ + 1/2 theta~^2

    kept to second order; where twist turns the planes of bending, theta2 = 1/2 int theta x theta' dx is added to theta. Assumes that mass
    and stiffness of sections vary alike. Returns: moments about the link's base frame.
    """
    first, rate = tilt(link)
    if link.coupled and link.couplings is not None:
        more = link.second_turns(link.couplings.turns)
        first, rate = ([a + b for a, b in zip(*pair, strict=True)] for pair in zip((first, rate), more, strict=True))
    second, swirl = spread(link, J), [J[a] * rate[a] for a in range(3)]
    for a in range(3):
        second[a][a] += J[a] * link.y.integrals.section
    for (a, b, c), sign in SIGNS.items():
        second[a][c] += sign * (J[c] - J[a]) * first[b]
        swirl[a] += sign * (J[c] - J[a] / 2) * mixed(link, b, c, rates=1)
    agitation = sum((J[a] * mixed(link, a, a, rates=2) for a in range(3)), ca.SX(0))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = second
    return Moments(second=tensor(xx, yy, zz, xy, xz, yz), swirl=column(*swirl), agitation=agitation)


def spread(link: BentLink, J: tuple[Any, Any, Any]) -> list[list[Any]]:
    """int theta~ J theta~^T + 1/2 (theta~^2 J + J theta~^2), rows of (3, 3)."""
    G = [[mixed(link, a, b, rates=0) for b in range(3)] for a in range(3)]
    trace = G[0][0] + G[1][1] + G[2][2]
    found = [[(G[a][b] - (trace if a == b else 0.0)) * (J[a] + J[b]) / 2 for b in range(3)] for a in range(3)]
    for ((a, p, c), one), ((b, q, d), other) in pairs(SIGNS.items(), repeat=2):
        if c == d:
            found[a][b] += one * other * J[c] * G[p][q]
    return found


def rotations(link: BentLink) -> tuple[tuple[Deflection, Any], ...]:
    """What turns a section about x, y and z, and what the turn of a unit of its coordinate is divided by."""
    length = link.table.length
    return (link.torsion, 1.0), (link.z, -length), (link.y, length)


def tilt(link: BentLink) -> tuple[list[Any], list[Any]]:
    """int theta and int theta', relative to the link's length."""
    values = [part.linear(part.integrals.rotation, over) for part, over in rotations(link)]
    return [value for value, _ in values], [rate for _, rate in values]


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
    return {(0, 1): k.z.section, (0, 2): k.y.section, (1, 2): k.sections.T}[a, b]
