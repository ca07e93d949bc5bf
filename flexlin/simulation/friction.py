"""Joints that stick: Coulomb friction as the set that it is."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from flexlin.checks import Array
from flexlin.control.sensors import encoder_rows
from flexlin.errors import ArgumentError
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.effects.base import per_joint
from flexlin.mechanics.effects.coulomb_friction import CoulombFriction


@dataclass(frozen=True, eq=False)
class Friction:
    """Friction of p joints: sliding it is `sliding` against the rate; at rest it is whatever holds the joint, up to `static`.

    rows, places: the joints among the coordinates y and those of the arm; table: the effect; links: behind the joints; static: (p,)
    in N m or N; rate: of the smooth friction sliding tanh(q' / rate) that the arm's equations hold; names: of the joints.
    """

    rows: tuple[int, ...]
    places: tuple[int, ...]
    table: CoulombFriction
    links: tuple[int, ...]
    static: Array
    rate: Array
    names: tuple[str, ...]

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, lin: Linearization) -> "Friction | None":
        """That of a scene whose friction sticks; None where there is none. Kept, with the functions that are made of it.

        Raises: ArgumentError where a joint's rate is no coordinate.
        """
        table = next((one for one in lin.effects if isinstance(one, CoulombFriction)), None)
        if table is None or table.static is None:
            return None
        if lin.arm.near.loops is not None:
            raise refuse("a closed loop of links")
        if np.any(encoder_rows(lin)[:, [c.kind == "elastic" for c in lin.coordinates]]):
            raise refuse("a link with pinned shapes")
        joints = [(row, c.link) for row, c in enumerate(lin.coordinates) if c.kind == "joint" and c.link is not None]
        static, rate = (np.array([per_joint(one, i) for _, i in joints]) for one in (table.static, table.rate))
        hold = static > 0
        rows, links = (tuple(int(k) for k in np.array(joints).reshape(-1, 2)[hold, i]) for i in (0, 1))
        places, names = tuple(lin.kept[row] for row in rows), tuple(lin.names[row] for row in rows)
        return cls(rows, places, table, links, static[hold], rate[hold], names)

    def level(self, which: int, rate: Any) -> Any:
        """The friction of one of the joints that slides at a rate, without its sign."""
        return self.table.sliding(self.links[which], rate)


def refuse(what: str) -> ArgumentError:
    """What to say of an arm whose joints cannot stick here."""
    return ArgumentError(
        "[effects.coulomb_friction] static: joints cannot stick here",
        got=what,
        expected="an open chain of clamped links, whose joints' rates are coordinates",
        todo="leave static out: the smooth friction acts everywhere",
    )
