"""Integration from event to event: drives whose torque changes at a limited rate, joints that stick and slide, layers no step may skip."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.layers import Layers
from flexlin.checks import Array
from flexlin.simulation.controlled_arm import ControlledArm
from flexlin.simulation.friction import Friction
from flexlin.simulation.marks import INSIDE, with_breaks
from flexlin.simulation.stepping import UNSEEN, TrialLeftRange, shorten, stopped
from flexlin.simulation.window import Grid, Path, between

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

PARTS = np.linspace(0.0, 1.0, 9)
"""Of a step: where the arguments of what saturates are looked at."""
PROBES = (0.25, 0.5, 0.75, 1.0)
"""Parts of a step at which the guards are looked at."""
MOST_EVENTS, MOST_AT_ONCE = 20_000, 20
"""Events of a run, and at one time, after which it is given up."""
STEP = 1e-6
"""Half of the step, in periods, of the difference that is the rate at which the asked torque changes."""
JUMP = 1e-9
"""A torque further from what is asked than this share of it has not caught up."""
Torque = Callable[[float, Array], tuple[Array, Array]]
"""Time and state -> the torque that the drive gives, and the rates of the controller's states."""
SLACK = 1e-9
"""Of the static friction: a joint breaks loose beyond it, so that one exactly at the limit stays."""


def hurries(layers: Layers, grid: Grid, path: Path) -> Array:
    """`Layers.hurry` of the steps (K,) of a window; coordinates of a controller stand behind those of the arm."""
    t, n = grid.edges[:-1, None] + grid.h[:, None] * PARTS, layers.about.n
    x = between(grid, path, np.zeros((grid.count, grid.stages)), t.ravel())[0].reshape(*t.shape, -1)
    return layers.hurry(t, x[..., :n], x[..., x.shape[-1] // 2 :][..., :n])


def skips_layer(layers: Layers | None, begin: float, end: float, dense: Callable[[Array], Array]) -> bool:
    """Whether one step of an integrator with states [y; y'; ...] (.., N) between passed a layer too fast to see it."""
    if layers is None:
        return False
    t, n = begin + (end - begin) * PARTS, layers.about.n
    x = dense(t).T
    return bool(layers.hurry(t[None], x[None, :, :n], x[None, :, n : 2 * n])[0] > 1)


class Switching(ABC):
    """A loop whose equations change with its modes; the first states of z are those of the loop."""

    loop: ControlledArm

    @abstractmethod
    def derivative(self, t: float, z: Array) -> Array:
        """z' in the present modes."""

    @abstractmethod
    def guards(self, t: float, z: Array) -> Array:
        """What stays above zero (p,) as long as the modes hold."""

    @abstractmethod
    def describe(self, which: int) -> str:
        """What goes on happening where one guard reaches zero again and again."""

    @abstractmethod
    def switch(self, t: float, z: Array, which: int) -> Array:
        """Change the modes where one guard has reached zero; returns the state from which it goes on."""

    def follow(self, t: Array, z: Array, rtol: float) -> Array:
        """States (N, len(z)) at increasing times t, from z at t[0].

        Raises: SimulationStopped where no step is short enough, or events follow each other without end.
        """
        now, end, out, done = float(t[0]), float(t[-1]), np.empty((len(t), len(z))), 1
        events = at_once = 0
        out[0] = z
        while now < end:
            for reached, upto, dense in self.steps(now, z, end, rtol):
                found = self.first_event(now, upto, dense)
                event, joint = (upto, None) if found is None else found
                count = int(np.searchsorted(t, event, side="right" if event >= end else "left"))
                if count > done:
                    out[done:count] = np.array([dense(one) for one in t[done:count]])
                    done = count
                at_once = at_once + 1 if event <= now else 0
                now, z = event, reached
                if joint is not None:
                    events += 1
                    if events > MOST_EVENTS or at_once > MOST_AT_ONCE:
                        raise stopped(now, self.describe(joint), dense(now)[: 2 * self.loop.n])
                    z = self.switch(now, dense(now), joint)
                    break
        return out

    def steps(
        self, now: float, z: Array, end: float, rtol: float
    ) -> Iterator[tuple[Array, float, Callable[[float], Array]]]:
        """Steps of an integrator in the present modes: state, time, and the polynomial between."""
        from scipy.integrate import LSODA

        first: float | None = None
        while now < end:
            solver: OdeSolver = LSODA(self.derivative, now, z, end, first_step=first, rtol=rtol, atol=rtol * 1e-2)
            try:
                while solver.status == "running":
                    message = solver.step()
                    if solver.status == "failed":
                        raise stopped(now, str(message), z[: 2 * self.loop.n])
                    dense = solver.dense_output()
                    if skips_layer(self.loop.layers, now, solver.t, dense):
                        first = shorten(solver.t - now, end - now, now, UNSEEN, z[: 2 * self.loop.n])
                        break
                    self.loop.accept(np.array([solver.t]), solver.y[None])
                    now, z = solver.t, solver.y.copy()
                    yield z, now, dense
            except TrialLeftRange as reason:
                first = shorten(min(first or end - now, end - now), end - now, now, str(reason), z[: 2 * self.loop.n])

    def first_event(self, begin: float, end: float, dense: Callable[[float], Array]) -> tuple[float, int] | None:
        """The first time in a step at which a guard reaches zero, and its joint."""
        low = begin
        for part in PROBES:
            high = begin + part * (end - begin)
            left = self.guards(high, dense(high))
            crossed = [self.root(low, high, dense, int(i)) for i in np.flatnonzero(left < 0)]
            if crossed:
                return min(crossed)
            low = high
        return None

    def root(self, low: float, high: float, dense: Callable[[float], Array], joint: int) -> tuple[float, int]:
        """Where one guard reaches zero between two times; the first of them where it is below zero there already."""
        from scipy.optimize import brentq  # takes longer to load than a report of a small arm

        at = partial(self._guard, dense=dense, joint=joint)
        inside = next((t for t in (low, *(low + (high - low) * 2.0**-k for k in range(1, 40))) if at(t) > 0), None)
        return (low if inside is None else float(brentq(at, inside, high, xtol=1e-15, rtol=1e-14))), joint

    def _guard(self, t: float, dense: Callable[[float], Array], joint: int) -> float:
        return float(self.guards(t, dense(t))[joint])


class Slewing(Switching):
    """States [z; g] of a loop whose m inputs follow what is asked (mode 0), or move at their limit (mode 1 or -1).

    mode 0: torque = asked, as long as |asked'| <= limit;   else torque = g, g' = mode limit, until g = asked
    """

    def __init__(self, loop: ControlledArm, limit: Array):
        self.loop, self.limit, self.mode = loop, limit, np.zeros(len(limit))

    def asked(self, t: float, z: Array) -> tuple[Array, Array]:
        """What the law asks (m,), and what of it the largest torque allows."""
        asked = self.loop.law(t, z[: self.loop.states])
        return asked, self.loop.drive.saturated(asked)

    def given(self, t: float, z: Array) -> Array:
        """The torque (m,)."""
        return np.where(self.mode == 0, self.asked(t, z)[1], z[-len(self.mode) :])

    def flow(self, t: float, z: Array) -> Array:
        """The rate of the loop's own states."""
        given, m = self.given(t, z), len(self.mode)
        remembered = self.loop.law.rate(t, z[: self.loop.states], self.asked(t, z)[0] - given)
        return self.loop.rate(t, z[:-m], given, remembered)

    def pace(self, t: float, z: Array) -> Array:
        """The rate (m,) at which what is asked, within the largest torque, changes along the motion."""
        h, rate = STEP * self.loop.lin.period, np.concatenate([self.flow(t, z), np.zeros(len(self.mode))])
        ahead, behind = (self.asked(t + sign * h, z + sign * h * rate)[1] for sign in (1, -1))
        return np.asarray((ahead - behind) / (2 * h))

    def derivative(self, t: float, z: Array) -> Array:
        slews = (
            self.mode * self.limit
            if self.mode.all()
            else np.where(self.mode == 0, self.pace(t, z), self.mode * self.limit)
        )
        return np.concatenate([self.flow(t, z), slews])

    def guards(self, t: float, z: Array) -> Array:
        behind = self.mode * (self.asked(t, z)[1] - z[-len(self.mode) :])
        return behind if self.mode.all() else np.where(self.mode == 0, self.limit - np.abs(self.pace(t, z)), behind)

    def describe(self, which: int) -> str:
        return f"input {which + 1} goes on leaving and reaching the limit of its rate"

    def switch(self, t: float, z: Array, which: int) -> Array:
        z, m, asked = z.copy(), len(self.mode), self.asked(t, z)[1]
        follows = self.mode[which] != 0
        self.mode[which], z[which - m] = 0.0, asked[which]
        pace = self.pace(t, z)[which]
        if not follows or abs(pace) > self.limit[which]:
            self.mode[which] = np.sign(pace)
        return z

    def enter(self, t: float, z: Array) -> Array:
        """Go on from torques g behind a break of the motion, where what is asked may jump."""
        asked, m = self.asked(t, z)[1], len(self.mode)
        apart = asked - z[-m:]
        self.mode = np.where(np.abs(apart) > JUMP * np.maximum(np.abs(asked), np.abs(z[-m:])), np.sign(apart), 0.0)
        pace = self.pace(t, z)
        self.mode = np.where((self.mode == 0) & (np.abs(pace) > self.limit), np.sign(pace), self.mode)
        return z

    def run(self, t: Array, z: Array, rtol: float) -> tuple[Array, Array]:
        """States (N, len(z)) of the loop and torques (N, m) at times t; the drive begins with what is asked, within its largest torque."""
        m, T = len(self.mode), self.loop.lin.period
        z, out = np.concatenate([z, self.asked(float(t[0]), z)[1]]), np.empty((len(t), len(z) + m))
        out[0], marks = z, with_breaks(t[[0, -1]], self.loop.lin, self.loop.rough)
        for begin, end in pairwise(marks):
            inside, first, last = (t > begin) & (t <= end), begin + INSIDE * T, end - INSIDE * T
            times = np.concatenate([[first], np.clip(t[inside], first, last), [last]])
            found = self.follow(times, self.enter(float(first), z), rtol)
            out[inside], z = found[1:-1], found[-1]
        return out[:, :-m], out[:, -m:]


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
