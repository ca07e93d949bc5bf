"""Joints that stick: Coulomb friction as the set that it is, and the acceleration of an arm some of whose joints it holds."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import lapack

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.control.sensors import encoder_rows
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.effects.base import per_joint
from flexlin.mechanics.effects.coulomb_friction import CoulombFriction
from flexlin.simulation.equations import deviation_equations
from flexlin.simulation.stopping import stopped


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

    def sliding(self, rates: Array) -> Array:
        """The friction (p,) of sliding at these rates, without its sign."""
        return np.array([float(self.level(which, rate)) for which, rate in enumerate(rates)])

    def smooth(self, rates: Array) -> Array:
        """The friction (p,) that the arm's equations hold."""
        return self.sliding(rates) * np.tanh(rates / self.rate)


def refuse(what: str) -> ArgumentError:
    """What to say of an arm whose joints cannot stick here."""
    return ArgumentError(
        "[effects.coulomb_friction] static: joints cannot stick here",
        got=what,
        expected="an open chain of clamped links, whose joints' rates are coordinates",
        todo="leave static out: the smooth friction acts everywhere",
    )


class Acceleration:
    """M y'' + J holding = B torque - (M s_R'' + C s' + g + d),   J' (s_R'' + y'') = 0 for the joints J that stick."""

    def __init__(self, lin: Linearization, friction: Friction | None):
        self.about, self.friction, self._kept, self._n = lin.about, friction, list(lin.kept), lin.n

    @lazy
    def _equations(self) -> ca.Function:
        return deviation_equations(self.about)

    def _evaluate(self, t: float, x: Array) -> list[Array]:
        return symbolic.call_at(self._equations, x, *self.about.place_at(t))

    def rates(self, t: float, x: Array) -> Array:
        """The rates s' of all coordinates of the arm in a state [y; y'] (2n,)."""
        return np.asarray(self._evaluate(t, x)[3][:, 0])

    def solve(self, t: float, x: Array, torque: Array, slip: Array | None = None) -> tuple[Array, Array, float]:
        """y'' (n,), the friction that holds the joints that stick, and the power into the arm, in a state x = [y; y'] (2n,).

        Parameters: slip: (p,) of the joints that may stick, 0 where one does and else the sign of its rate; None: smooth friction.
        Raises: SimulationStopped where the mass matrix is not positive definite.
        """
        M, B, left, rates, lost = self._evaluate(t, x)
        kept, left, rates, friction = self._kept, left[:, 0], rates[:, 0], self.friction
        if friction is not None and slip is not None:
            moving = list(friction.places)
            added = slip * friction.sliding(rates[moving]) - friction.smooth(rates[moving])
            left[moving] += added
            lost = lost + rates[moving] @ added
        _, acceleration, failed = lapack.dposv(M[kept], (B @ torque - left)[kept])
        if failed:
            raise stopped(t, "the mass matrix is not positive definite there", x)
        holding = np.zeros(0)
        if friction is not None and slip is not None and not np.all(slip):
            stuck = [row for row, mode in zip(friction.rows, slip, strict=True) if mode == 0]
            led = self.about.positions(np.array([t]), *np.zeros((3, 1, self._n)))[2][0, kept][stuck]
            reply = lapack.dposv(M[kept], np.eye(self._n)[:, stuck])[1]
            holding = np.linalg.solve(reply[stuck], acceleration[stuck] + led)
            acceleration = acceleration - reply @ holding
        return acceleration, holding, float(rates @ (left + M @ acceleration) - lost[0, 0])
