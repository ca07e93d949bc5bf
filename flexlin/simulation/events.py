"""Integration from event to event: between them the equations are smooth, and each event is found."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.checks import Array
from flexlin.simulation.controlled_arm import ControlledArm
from flexlin.simulation.layers import skips_layer
from flexlin.simulation.stepping import UNSEEN, TrialLeftRange, shorten, stopped

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver


PROBES = (0.25, 0.5, 0.75, 1.0)
"""Parts of a step at which the guards are looked at."""
MOST_EVENTS, MOST_AT_ONCE = 20_000, 20
"""Events of a run, and at one time, after which it is given up."""


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
