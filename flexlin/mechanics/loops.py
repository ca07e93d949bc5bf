"""The loops of a scene: which equations hold its links together, and the manipulator that obeys them."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from flexlin.errors import ModelError
from flexlin.mechanics.closed_loop import close_loop
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.frames import Frame, column
from flexlin.mechanics.manipulator import Manipulator
from flexlin.mechanics.points import list_points
from flexlin.scene.links import BASE, Link, Loop
from flexlin.scene.scene import Scene


def close_scene_loops(arm: Manipulator, chain: Chain, scene: Scene) -> Manipulator:
    """The manipulator in the coordinates that are left when the passive joints follow from the closure of all loops.

        f(s) = [p_link - p_to - R_to x] = 0, one block a loop

    Raises: ModelError when there are not as many passive joints as equations; what `close_loop` raises.
    """
    passive = [place for place, i in enumerate(chain.moving) if scene.links[i].passive]
    motors = [place for place in range(len(chain.moving)) if place not in passive]
    gap = join_tips(scene.loops, scene.links, chain.tips)
    if gap.numel() != len(passive):
        raise ModelError(
            "the passive joints do not fit the loops",
            got=f"{len(passive)} passive joints",
            expected=f"{gap.numel()}, one for each equation of closure (3 a loop, in a plane 2)",
            todo="set passive = true on the joints that the loops move, and on no others",
        )
    posture = np.zeros(arm.n)
    nominal = ca.Function(
        "posture", [arm.parameters.symbols], [ca.vertcat(*[scene.links[i].posture for i in chain.moving])]
    )
    posture[: len(chain.moving)] = nominal(arm.parameters.values).full()[:, 0]
    independent = [i for i in range(arm.n) if i not in passive]
    names = [link.name for link in scene.links]
    holders = {names.index(loop.link): names.index(loop.to) for loop in scene.loops if loop.to != BASE}
    closed = close_loop(replace(arm, points=list_points(chain, holders)), gap, independent, motors, posture)
    return replace(closed, effects=arm.effects)


def join_tips(loops: Sequence[Loop], links: Sequence[Link], tips: Sequence[Frame]) -> ca.SX:
    """The closure equations f(s), in m: what stays zero whatever the coordinates are, as across a plane, is no equation."""
    names = [link.name for link in links]
    gaps = []
    for loop in loops:
        held, by = tips[names.index(loop.link)], Frame.fixed() if loop.to == BASE else tips[names.index(loop.to)]
        gaps.append(held.position - by.moved(column(*loop.point), ca.SX(3, 1)).position)
    gap = ca.sparsify(ca.vertcat(*gaps))
    return ca.densify(gap[gap.sparsity().row()])
