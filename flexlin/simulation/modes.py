"""The equations of a loop in one of its modes: inputs held at a limit or on a ramp, joints that stick or slide one way."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.control.sensors import encoder_rows
from flexlin.errors import ArgumentError
from flexlin.linearization.deviation import Deviation, loop_expressions
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


SAMPLED = 3


@dataclass
class Modes:
    """What the m inputs and the p joints that may stick do, from one event to the next.

    held: 0 where an input follows the law, 1 or -1 at its limit, 2 or -2 where it changes as fast as it may, SAMPLED from sample to
    sample; held inputs give base + ramp (t - since); slip: 0 where a joint sticks, else the sign of its rate.
    """

    held: Array
    base: Array
    ramp: Array
    since: Array
    slip: Array

    @classmethod
    def free(cls, inputs: int, joints: int) -> "Modes":
        """All inputs follow the law; joints stick."""
        held, base, ramp, since = np.zeros((4, inputs))
        return cls(held, base, ramp, since, np.zeros(joints))

    @classmethod
    def at_many(cls, modes: "list[Modes]", which: Array) -> "Modes":
        """Those of a list that held at many times, (N, m) and (N, p)."""
        return cls(*(np.array(parts)[which] for parts in zip(*(vars(one).values() for one in modes), strict=True)))

    def given(self, t: Array, asked: Array) -> Array:
        """The torque (.., m) at times t (..) at which the law asks for `asked`."""
        return np.where(self.held == 0, asked, self.base + self.ramp * (t[..., None] - self.since))


def in_modes(about: Deviation, friction: Friction | None) -> tuple[dict[str, ca.SX], ca.SX, ca.SX, ca.SX]:
    """`loop_expressions`, with the slip of joints that stick among the inputs.

    sliding:  M s'' + C s' + g + d + sign F_sliding = B torque;   sticking: s'' = 0 for the joint instead
    """
    inputs, angles, F, power = loop_expressions(about)
    if friction is not None:
        slip, places = ca.SX.sym("slip", len(friction.rows)), list(friction.places)
        expressions = [about.arm.s_dot[places], about.arm.s_ddot[places]]
        rates, accelerations = about.lift(expressions, angles, inputs["y"], inputs["y1"], inputs["y2"])
        for i, row in enumerate(friction.rows):
            added = (slip[i] - ca.tanh(rates[i] / friction.rate[i])) * friction.level(i, rates[i])
            F[row] = slip[i] ** 2 * (F[row] + added) + (1 - slip[i] ** 2) * accelerations[i]
            power -= rates[i] * added
        inputs["slip"] = slip
    return inputs, angles, F, power


@lru_cache(maxsize=8)
def holding_function(about: Deviation, friction: Friction) -> ca.Function:
    """The friction (p,) that the joints would need at these accelerations, of y, y', y'', the torque and the place on the motion."""
    inputs, angles, F, _ = loop_expressions(about)
    rates = about.lift([about.arm.s_dot[list(friction.places)]], angles, inputs["y"], inputs["y1"])[0]
    smooth = [friction.level(i, rates[i]) * ca.tanh(rates[i] / friction.rate[i]) for i in range(len(friction.rows))]
    return about.function(angles, inputs, {"holding": ca.vertcat(*smooth) - F[list(friction.rows)]})


def find_holding(about: Deviation, friction: Friction, t: Array, parts: tuple[Array, ...], torque: Array) -> Array:
    """The friction (N, p) that joints need at times t (N,) in a motion y, y', y'' (N, n) under a torque (N, m)."""
    found = symbolic.call(holding_function(about, friction), [*parts, torque, *about.place(t)])[0]
    return np.asarray(found[:, :, 0])
