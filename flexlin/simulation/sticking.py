"""A loop whose joints stick and slide: which do, when that changes, and what holds them."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.controlled_arm import ControlledArm
from flexlin.simulation.events import Switching
from flexlin.simulation.friction import Friction

Torque = Callable[[float, Array], tuple[Array, Array]]
"""Time and state -> the torque that the drive gives, and the rates of the controller's states."""
SLACK = 1e-9
"""Of the static friction: a joint breaks loose beyond it, so that one exactly at the limit stays."""


@dataclass
class Sticking(Switching):
    """The joints' modes `slip`: 0 where one sticks, else the direction in which it slides; `events`: time, joint, and what it does then."""

    loop: ControlledArm
    torque: Torque
    slip: Array = field(default_factory=lambda: np.zeros(0))
    events: list[tuple[float, str, str]] = field(default_factory=list)

    @property
    def friction(self) -> Friction:
        """That of the loop."""
        assert self.loop.friction is not None
        return self.loop.friction

    def derivative(self, t: float, z: Array) -> Array:
        given, remembered = self.torque(t, z)
        return self.loop.rate(t, z, given, remembered, self.slip)

    def begin(self, t: float, z: Array) -> Array:
        """Choose the modes of a start; returns the state, with the rates of joints that stick made exact."""
        rates = self.rates(t, z)
        self.slip = np.where(np.abs(rates) > SLACK, np.sign(rates), 0.0)
        return self.settle(t, z.copy())

    def rates(self, t: float, z: Array) -> Array:
        """The rates (p,) of the joints themselves, the motion's included."""
        return self.loop.equations.rates(t, z[: 2 * self.loop.n])[list(self.friction.places)]

    def guards(self, t: float, z: Array) -> Array:
        """What stays above zero (p,) as long as the modes hold: the rate along the slip, or what static friction has left."""
        left, stuck = self.slip * self.rates(t, z), self.slip == 0
        if stuck.any():
            holding = self.loop.equations.solve(t, z[: 2 * self.loop.n], self.torque(t, z)[0], self.slip)[1]
            left[stuck] = (1 + SLACK) * self.friction.static[stuck] - np.abs(holding)
        return left

    def settle(self, t: float, z: Array) -> Array:
        """Let joints break loose that friction cannot hold, the worst first, and stop those that stick exactly."""
        for row, place, mode in zip(self.friction.rows, range(len(self.slip)), self.slip, strict=True):
            if mode == 0:
                z[self.loop.n + row] -= self.rates(t, z)[place]
        for _ in range(len(self.slip)):
            stuck = np.flatnonzero(self.slip == 0)
            if not len(stuck):
                break
            holding = self.loop.equations.solve(t, z[: 2 * self.loop.n], self.torque(t, z)[0], self.slip)[1]
            over = np.abs(holding) - (1 + SLACK) * self.friction.static[stuck]
            worst = int(np.argmax(over))
            if over[worst] <= 0:
                break
            self.slip[stuck[worst]] = np.sign(holding[worst])
        return z

    def describe(self, which: int) -> str:
        return f"joint {self.friction.names[which]} goes on changing between sticking and sliding"

    def switch(self, t: float, z: Array, which: int) -> Array:
        """One joint's guard has reached zero: what stuck breaks loose; what slid rests, and moves on only if friction cannot hold it."""
        before = self.slip.copy()
        if before[which] == 0:
            held = self.loop.equations.solve(t, z[: 2 * self.loop.n], self.torque(t, z)[0], self.slip)[1]
            self.slip[which] = np.sign(held[int(np.sum(before[:which] == 0))])
        else:
            self.slip[which] = 0.0
        return self.note(t, z, before)

    def note(self, t: float, z: Array, before: Array) -> Array:
        """Settle the joints, and write down whose mode is no longer what it was before."""
        z = self.settle(t, z.copy())
        for i in np.flatnonzero(self.slip != before):
            self.events.append((t, self.friction.names[i], "slides" if self.slip[i] else "sticks"))
        return z
