"""Integration of a loop whose joints stick and slide: between the events the equations are smooth, and each event is found."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from flexlin.checks import Array
from flexlin.simulation.friction import Friction
from flexlin.simulation.stepping import SHORTENED, SHORTEST, TrialLeftRange, stopped

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver

    from flexlin.simulation.loop import NonlinearLoop

Torque = Callable[[float, Array], tuple[Array, Array]]
"""Time and state -> the torque that the drive gives, and the rates of the controller's states."""
PROBES = (0.25, 0.5, 0.75, 1.0)
"""Parts of a step at which the guards are looked at."""
SLACK = 1e-9
"""Of the static friction: a joint breaks loose beyond it, so that one exactly at the limit stays."""
MOST_EVENTS, MOST_AT_ONCE = 20_000, 20
"""Events of a run, and at one time, after which it is given up."""


@dataclass
class Sticking:
    """The joints' modes `slip`: 0 where one sticks, else the direction in which it slides; `events`: time, joint, and what it does then."""

    loop: "NonlinearLoop"
    slip: Array = field(default_factory=lambda: np.zeros(0))
    events: list[tuple[float, str, str]] = field(default_factory=list)
    switches: int = 0
    still: int = 0
    last: float = -np.inf

    @property
    def friction(self) -> Friction:
        """That of the loop."""
        assert self.loop.friction is not None
        return self.loop.friction

    def begin(self, t: float, z: Array, torque: Torque) -> Array:
        """Choose the modes of a start; returns the state, with the rates of joints that stick made exact."""
        rates = self.rates(t, z)
        self.slip = np.where(np.abs(rates) > SLACK, np.sign(rates), 0.0)
        return self.settle(t, z.copy(), torque)

    def rates(self, t: float, z: Array) -> Array:
        """The rates (p,) of the joints themselves, the motion's included."""
        return self.loop.equations.rates(t, z[: 2 * self.loop.n])[list(self.friction.places)]

    def guards(self, t: float, z: Array, torque: Torque) -> Array:
        """What stays above zero (p,) as long as the modes hold: the rate along the slip, or what static friction has left."""
        left, stuck = self.slip * self.rates(t, z), self.slip == 0
        if stuck.any():
            holding = self.loop.equations.solve(t, z[: 2 * self.loop.n], torque(t, z)[0], self.slip)[1]
            left[stuck] = (1 + SLACK) * self.friction.static[stuck] - np.abs(holding)
        return left

    def settle(self, t: float, z: Array, torque: Torque) -> Array:
        """Let joints break loose that friction cannot hold, the worst first, and stop those that stick exactly."""
        for row, place, mode in zip(self.friction.rows, range(len(self.slip)), self.slip, strict=True):
            if mode == 0:
                z[self.loop.n + row] -= self.rates(t, z)[place]
        for _ in range(len(self.slip)):
            stuck = np.flatnonzero(self.slip == 0)
            if not len(stuck):
                break
            holding = self.loop.equations.solve(t, z[: 2 * self.loop.n], torque(t, z)[0], self.slip)[1]
            over = np.abs(holding) - (1 + SLACK) * self.friction.static[stuck]
            worst = int(np.argmax(over))
            if over[worst] <= 0:
                break
            self.slip[stuck[worst]] = np.sign(holding[worst])
        return z

    def switch(self, t: float, z: Array, torque: Torque, joint: int) -> Array:
        """One joint's guard has reached zero: what stuck breaks loose; what slid rests, and moves on only if friction cannot hold it."""
        self.switches, self.still = self.switches + 1, self.still + 1 if t <= self.last else 0
        self.last = t
        if self.switches > MOST_EVENTS or self.still > MOST_AT_ONCE:
            got = f"joint {self.friction.names[joint]} goes on changing between sticking and sliding"
            raise stopped(t, got, z[: 2 * self.loop.n])
        before = self.slip.copy()
        if before[joint] == 0:
            held = self.loop.equations.solve(t, z[: 2 * self.loop.n], torque(t, z)[0], self.slip)[1]
            self.slip[joint] = np.sign(held[int(np.sum(before[:joint] == 0))])
        else:
            self.slip[joint] = 0.0
        return self.note(t, z, torque, before)

    def note(self, t: float, z: Array, torque: Torque, before: Array) -> Array:
        """Settle the joints, and write down whose mode is no longer what it was before."""
        z = self.settle(t, z.copy(), torque)
        for i in np.flatnonzero(self.slip != before):
            self.events.append((t, self.friction.names[i], "slides" if self.slip[i] else "sticks"))
        return z

    def follow(self, t: Array, z: Array, rtol: float, torque: Torque) -> Array:
        """States (N, len(z)) at increasing times t, from z at t[0].

        Raises: SimulationStopped where no step is short enough.
        """
        now, end, out, done = float(t[0]), float(t[-1]), np.empty((len(t), len(z))), 1
        out[0] = z
        while now < end:
            for reached, upto, dense in self.steps(now, z, end, rtol, torque):
                found = self.first_event(now, upto, dense, torque)
                event, joint = (upto, None) if found is None else found
                count = int(np.searchsorted(t, event, side="right" if event >= end else "left"))
                if count > done:
                    out[done:count] = np.array([dense(one) for one in t[done:count]])
                    done = count
                now, z = event, reached
                if joint is not None:
                    z = self.switch(now, dense(now), torque, joint)
                    break
        return out

    def steps(self, now: float, z: Array, end: float, rtol: float, torque: Torque):  # type: ignore[no-untyped-def]
        """Steps of an integrator in the present modes: state, time, and the polynomial between."""
        from scipy.integrate import LSODA

        def rate(t: float, z: Array) -> Array:
            given, remembered = torque(t, z)
            return self.loop.rate(t, z, given, remembered, self.slip)

        first: float | None = None
        while now < end:
            solver: OdeSolver = LSODA(rate, now, z, end, first_step=first, rtol=rtol, atol=rtol * 1e-2)
            try:
                while solver.status == "running":
                    message = solver.step()
                    if solver.status == "failed":
                        raise stopped(now, str(message), z[: 2 * self.loop.n])
                    self.loop.accept(solver.t, solver.y)
                    now, z = solver.t, solver.y.copy()
                    yield z, now, solver.dense_output()
            except TrialLeftRange as reason:
                first = SHORTENED * min(first or end - now, end - now)
                if first <= SHORTEST * (end - now):
                    raise stopped(now, f"no step is short enough: {reason}", z[: 2 * self.loop.n]) from None

    def first_event(
        self, begin: float, end: float, dense: Callable[[float], Array], torque: Torque
    ) -> tuple[float, int] | None:
        """The first time in a step at which a guard reaches zero, and its joint."""
        low = begin
        for part in PROBES:
            high = begin + part * (end - begin)
            left = self.guards(high, dense(high), torque)
            crossed = [self.root(low, high, dense, torque, int(i)) for i in np.flatnonzero(left < 0)]
            if crossed:
                return min(crossed)
            low = high
        return None

    def root(
        self, low: float, high: float, dense: Callable[[float], Array], torque: Torque, joint: int
    ) -> tuple[float, int]:
        """Where one guard reaches zero between two times; the first of them where it is below zero there already."""
        at = partial(self._guard, dense=dense, torque=torque, joint=joint)
        inside = next((t for t in (low, *(low + (high - low) * 2.0**-k for k in range(1, 40))) if at(t) > 0), None)
        return (low if inside is None else float(brentq(at, inside, high, xtol=1e-15, rtol=1e-14))), joint

    def _guard(self, t: float, dense: Callable[[float], Array], torque: Torque, joint: int) -> float:
        return float(self.guards(t, dense(t), torque)[joint])
