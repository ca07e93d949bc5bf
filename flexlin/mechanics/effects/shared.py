"""Numbers of an effect that its table gives once for all joints or links, or in a list."""

from typing import Any

import casadi as ca

from flexlin.mechanics.effects.base import Chain


def per_joint(value: Any, joint: int, *, single: str) -> Any:
    """Read a table's value for one joint: a tuple by index; a single number stands for the `"first"` joint or for `"every"` one."""
    if isinstance(value, tuple):
        return value[joint] if joint < len(value) else 0.0
    return value if single == "every" or joint == 0 else 0.0


def at_tip(value: Any, link: int, links: int) -> Any:
    """Read a table's value for the tip of one link: a tuple by index; a single number stands for the last link."""
    if isinstance(value, tuple):
        return value[link] if link < len(value) else 0.0
    return value if link == links - 1 else 0.0


def per_motor(value: Any, chain: Chain) -> ca.SX:
    """Read a table's value for each joint that moves, (joints, 1): zero for a passive joint, which has no motor."""
    links = chain.links
    found = [0.0 if links[i].table.passive else per_joint(value, i, single="every") for i in chain.moving]
    return ca.vertcat(ca.SX(0, 1), *found)
