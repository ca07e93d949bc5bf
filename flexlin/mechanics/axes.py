"""The axes of a chain's links as curves, for pictures."""

from collections.abc import Mapping, Sequence

import casadi as ca

from flexlin.mechanics.body import is_same
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.links import PLACES
from flexlin.scene.links import NO_LINK

ALONG = ca.DM(PLACES).T
COLUMNS = len(PLACES) + 1
"""Columns for each link: where the link before it ends, and the places of its axis."""


def list_axes(chain: Chain) -> ca.SX:
    """World positions (3, COLUMNS links) of points on the links' axes, each link behind where the one that carries it ends.

    What effects add at a link's tip is added in proportion to x. Links that stand on the ground, or slide as a loop lets them, begin at
    their own joint.
    """
    curves = []
    for i, (link, tip) in enumerate(zip(chain.links, chain.tips, strict=True)):
        slides = link.table.passive and link.table.joint == "prismatic"
        before = chain.joints[i] if slides or chain.parents[i] == NO_LINK else chain.tips[chain.parents[i]]
        own = link.axis()
        curves += [before.position, own + (tip.position - own[:, -1]) @ ALONG]
    return ca.densify(ca.horzcat(*curves))


Place = tuple[int, bool]
"""A link's joint (link, False) or its tip (link, True)."""


def list_points(chain: Chain, holders: Mapping[int, int] | None = None) -> ca.SX:
    """Where the joints and the last tip are, (2, k) for an arm that cannot leave its plane, else (3, k).

    Where links branch the way goes back along each branch, so two neighbours lie on one body or on the ground. `holders`: for links
    whose tip a loop holds, the link that does: a branch then goes on to that link's tip.
    """
    lengths = [link.table.length for link in chain.links]
    places = walk_tree(chain.parents, holders or {}, [is_same(ca.SX(length), ca.SX(0)) for length in lengths])
    if list(chain.parents) == list(range(-1, len(chain.links) - 1)):
        visited = [frame.position for frame in (*chain.joints, chain.tips[-1])]
    else:
        met = [(chain.tips if at_tip else chain.joints)[i].position for i, at_tip in places]
        visited = [point for k, point in enumerate(met) if k == 0 or not is_same(point, met[k - 1])]
    points = ca.sparsify(ca.horzcat(*visited))
    return ca.densify(points if points[2, :].nnz() else points[:2, :])


def walk_tree(parents: Sequence[int], holders: Mapping[int, int], short: Sequence[bool]) -> list[Place]:
    """The joints and tips that are met from the first link's base to the last link's tip.

    A body that loops alone carry, whose links on the way from the ground have no length (`short`), is met at its tip only.
    """

    def way_to(link: int) -> list[int]:
        return [] if link == NO_LINK else [*way_to(parents[link]), link]

    def places(path: list[int]) -> list[Place]:
        end = [(holders[path[-1]], True)] if path and path[-1] in holders else []
        return [*((i, at_tip) for i in path for at_tip in (False, True)), *end]

    held = set(holders.values())
    ways = [way_to(end) for end in range(len(parents)) if end not in parents]
    drawn = [way for way in ways if not (way[-1] in held and all(short[i] for i in way))]
    walk, before = list[Place](), list[int]()
    for way in drawn:
        shared = sum(a == b for a, b in zip(way, before, strict=False))
        walk += places(before[shared:])[::-1][1:] + places(way[shared:])
        before = way
    last = (len(parents) - 1, True)
    return walk if walk[-1] == last else [*walk, last]
