"""The axes of a chain's links as curves, for pictures."""

import casadi as ca

from flexlin.mechanics.deflection import PLACES
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.frames import Frame
from flexlin.mechanics.links import BentLink
from flexlin.scene.links import NO_LINK

ALONG = ca.DM(PLACES).T
COLUMNS = len(PLACES) + 1
"""Columns for each link: where the link before it ends, and the places of its axis."""


def list_axes(chain: Chain) -> ca.SX:
    """World positions (3, COLUMNS links) of points on the links' axes, each link behind where the one that carries it ends.

    Links that stand on the ground, or slide as a loop lets them, begin at their own joint.
    """
    curves = []
    for i, (link, tip) in enumerate(zip(chain.links, chain.tips, strict=True)):
        slides = link.table.passive and link.table.joint == "prismatic"
        before = chain.joints[i] if slides or chain.parents[i] == NO_LINK else chain.tips[chain.parents[i]]
        curves += [before.position, trace_axis(link, tip)]
    return ca.densify(ca.horzcat(*curves))


def trace_axis(link: BentLink, tip: Frame) -> ca.SX:
    """The bent axis of a link, (3, places), in world axes.

    r(x) = r_0 + R (x, v, w), and in proportion to x what effects add at the tip.
    """
    v, w = (part.w.T @ ca.DM(part.basis.axis) if part.n else ca.SX(1, len(PLACES)) for part in (link.y, link.z))
    own = ca.repmat(link.base.position, 1, len(PLACES)) + link.base.rotation @ ca.vertcat(
        link.table.length * ALONG, v, w
    )
    return own + (tip.position - own[:, -1]) @ ALONG
