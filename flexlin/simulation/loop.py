"""The nonlinear equations of motion under a control law, integrated: by collocation, from event to event, or from sample to sample."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.law import Law
from flexlin.checks import Array
from flexlin.errors import SimulationStopped
from flexlin.lazy import lazy
from flexlin.periodic.sampled import hold_controller
from flexlin.simulation.collocation import ROUNDING, Collocation
from flexlin.simulation.controlled_arm import ControlledArm, explain_end, find_indefinite
from flexlin.simulation.equations import (
    Equations,
    NonlinearEquations,
    from_coordinates,
    to_coordinates,
    with_controller,
)
from flexlin.simulation.events import Events
from flexlin.simulation.layers import hurries, skips_layer
from flexlin.simulation.marks import with_breaks
from flexlin.simulation.mesh import Trail
from flexlin.simulation.modes import ModedEquations, with_modes
from flexlin.simulation.stepping import march, stopped

if TYPE_CHECKING:
    from scipy.integrate import DOP853

CLOSE = 0.999
"""A torque nearer to its limit than this, at any stage of the collocation, may be cut between the stages."""
CHECKED = 64
"""Windows after which the mass matrices of the states that they reached are looked at, all in one call."""


class TorqueCut(Exception):
    """The drive does not give the torque that the law commands."""


class NonlinearLoop(ControlledArm):
    """A controlled arm, integrated by collocation: as a whole while the drive gives what is commanded, else from event to event.

    Where the torque is sampled and held an explicit method follows it from sample to sample.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> from flexlin.simulation import NonlinearLoop
    >>> scene = fl.load_scene("single-link", {"links.0.modes": 1, "designs": []})
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> loop = NonlinearLoop(lin, lin.law)
    >>> loop.integrate(np.array([0.0, 0.1]), np.zeros(4), 1e-6).shape
    (2, 5)
    """

    def integrate(self, t: Array, start: Array, rtol: float, stages: int = 5) -> Array:
        """Integrate from a start.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s; the first is that of the start.
        start : array, shape (2n + k,)
            State [y; y'; z] at the first time.
        rtol : float
            Relative tolerance of the integrator.
        stages : int
            Of the collocation, which serves as long as the drive gives what is commanded; a torque that is held or cut is stepped through.

        Returns
        -------
        array, shape (N, 2n + k + 1)
            States [y; y'; z; work] at the times.

        Raises
        ------
        SimulationStopped
            When the loop diverges, or when the integrator cannot go on.
        """
        return self.beside_linear(t, start, rtol, stages, linear=False)[0]

    def beside_linear(
        self, t: Array, start: Array, rtol: float, stages: int, linear: bool = True, trail: Trail | None = None
    ) -> tuple[Array, Array | None]:
        """Integrate from a start, and the linear equations on the same steps.

        Parameters
        ----------
        t, start, rtol, stages : array, array, float, int
            As for `integrate`.
        linear : bool
            Whether the linear answer is wanted.
        trail : Trail, optional
            Of another run, for a start of this one.

        Returns
        -------
        z : array, shape (N, 2n + k + 1)
            What `integrate` returns.
        x : array, shape (N, 2n + k), or None
            States of the linear equations; none where the torque is held or cut.
        """
        z, self.reached = np.append(start, 0.0), []
        self.accept(t[:1], z[None])
        try:
            if self.drive.sample_time is not None:
                return follow_held(self, t, z, rtol), None
            self._switches = self._switches or self.drive.rate is not None or self.friction is not None
            if not self._switches:
                try:
                    found = self._collocated(t, start, rtol, stages, linear, trail)
                except TorqueCut:
                    self._switches, self.reached = True, self.reached[:1]
            if self._switches:
                linear, found = False, self._switched(t, start, rtol, stages)
        except SimulationStopped as end:
            raise (explain_end(self.lin, end) if end.reached is not None else end) from None
        n, k = self.n, self._law.memory
        states, beside = found[:, : 2 * (n + k)], found[:, 2 * (n + k) + 1 :]
        z = np.column_stack([from_coordinates(states, n, k), found[:, 2 * (n + k)]])
        return z, from_coordinates(beside, n, k) if linear else None

    @lazy
    def _collocation(self) -> Equations:
        return with_controller(self._equations_under(self._law.direct), self._law)

    def _equations_under(self, law: Law) -> NonlinearEquations:
        """The equations of the arm under a law without a controller."""
        return NonlinearEquations(self.lin, law)

    def _collocated(self, t: Array, start: Array, rtol: float, stages: int, linear: bool, trail: Trail | None) -> Array:
        """The smooth loop. Raises: TorqueCut where the drive does not give the torque that is commanded."""
        found, self.trail = self._integrate(self._collocation, t, start, rtol, stages, None, linear, trail)
        return found

    def _switched(self, t: Array, start: Array, rtol: float, stages: int) -> Array:
        """From event to event, in a mode at a time."""
        events, law = Events(self, self._law), self._law
        arm = ModedEquations(self.lin, law.direct, events.modes, self.friction)
        x = events.begin(float(t[0]), start)
        found, _ = self._integrate(with_modes(arm, law), t, x, rtol, stages, events)
        n, k = self.n, law.memory
        asked = law.torque(self._now(t), from_coordinates(found[:, :-1], n, k))
        self.events, self.given = tuple(events.notes), events.torques(t, asked)
        return found

    def _integrate(
        self,
        equations: Equations,
        t: Array,
        start: Array,
        rtol: float,
        stages: int,
        events: Events | None,
        linear: bool = False,
        trail: Trail | None = None,
    ) -> tuple[Array, Trail | None]:
        """States by collocation, each looked at once it is reached."""
        marks, limit = with_breaks(t[[0, -1]], self.lin, self.rough), self.drive.limit
        passed: list[tuple[Array, Array]] = []

        def accept(t: Array, x: Array, torque: Array) -> None:
            if events is None and limit is not None and np.any(np.abs(torque) > CLOSE * np.array(limit)):
                raise TorqueCut
            self.accept(t, x)
            passed.append((t, x))
            if len(passed) >= CHECKED:
                self._check_mass(passed)

        watched = None if self.layers is None else partial(hurries, self.layers)
        tol = max(rtol, ROUNDING)
        integrator = Collocation(equations, self.lin.period, stages, tol, accept, watched, events)
        try:
            return integrator.integrate(t, to_coordinates(start, self.n), marks, linear, trail)
        finally:
            self._check_mass(passed)

    def _check_mass(self, passed: list[tuple[Array, Array]]) -> None:
        """Raises: SimulationStopped, naming the time, where the mass matrix of a state that was reached is not positive definite."""
        if not passed:
            return
        t, x = map(np.concatenate, zip(*passed, strict=True))
        passed.clear()
        first = find_indefinite(self.lin, t, x)
        if first is not None:
            raise stopped(float(t[first]), "the mass matrix is not positive definite there", x[first])


def follow_held(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) from instant to instant at which the torque changes, sampling measured `delay` before.

    The controller's own states move from sample to sample, as what was measured and asked at the first of them has it. The loop's `given`
    torques are set.
    """
    step, delay = loop.drive.sample_time or 1.0, loop.drive.delay
    controller, plant = loop.controller, 2 * loop.n
    held = None if controller is None else hold_controller(controller.rates, step)
    out, torque = np.empty((len(t), len(z))), loop.command(t[0], loop.measure(t[0], z[:-1]))
    out[0], now, done, sample = z, float(t[0]), 1, 0
    loop.given = np.tile(torque, (len(t), 1))
    while done < len(t):
        measured = t[0] + sample * step
        seen = loop.measure(measured, z[:-1])
        asked = loop.asked(measured, seen)
        given, after = loop.drive.saturated(asked), z[plant:-1]
        if held is not None:
            after = after + held @ loop.remembered(measured, seen, asked - given)
        for until, later in ((measured + delay, given), (measured + step, given)):
            if until > now:
                stops = t[done : int(np.searchsorted(t, until + 1e-12 * step, side="right"))]
                make = partial(explicit, loop, torque=torque, end=until, rtol=rtol)
                z, values = march(
                    make, z, now, until, stops, loop.accept, partial(skips_layer, loop.layers), first=until - now
                )
                out[done : done + len(stops)], loop.given[done : done + len(stops)] = values, torque
                done, now = done + len(stops), until
            torque = later
        z = np.concatenate([z[:plant], after, z[-1:]])
        sample += 1
    return out


def explicit(loop: ControlledArm, t: float, z: Array, first: float, torque: Array, end: float, rtol: float) -> "DOP853":
    """An integrator under a constant torque."""
    from scipy.integrate import DOP853

    rate = partial(loop.rate, torque=torque)
    return DOP853(rate, t, z, end, rtol=max(rtol, 1e-13), atol=rtol * 1e-2, first_step=first)
