"""The nonlinear equations of motion under a control law, integrated: by collocation, or step by step where the drive cuts the torque."""

from functools import partial
from itertools import pairwise
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
from flexlin.simulation.events import Slewing, Sticking, hurries, skips_layer
from flexlin.simulation.marks import INSIDE, with_breaks
from flexlin.simulation.mesh import Trail
from flexlin.simulation.stepping import march, stopped

if TYPE_CHECKING:
    from scipy.integrate import DOP853, LSODA

CLOSE = 0.999
"""A torque nearer to its limit than this, at any stage of the collocation, is integrated as one that is cut."""
CHECKED = 64
"""Windows after which the mass matrices of the states that they reached are looked at, all in one call."""


class TorqueCut(Exception):
    """The drive does not give the torque that the law commands."""


class NonlinearLoop(ControlledArm):
    """A controlled arm, integrated: by collocation while the drive gives what is commanded, else step by step.

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
        stepped = any(one is not None for one in (self.drive.sample_time, self.drive.rate, self.friction))
        try:
            if stepped:
                return self._stepped(t, z, rtol), None
            try:
                found = self._collocated(t, start, rtol, stages, linear, trail)
            except TorqueCut:
                return self._stepped(t, z, rtol), None
        except SimulationStopped as end:
            raise (explain_end(self.lin, end) if end.reached is not None else end) from None
        n, k = self.n, self._law.memory
        states, beside = found[:, : 2 * (n + k)], found[:, 2 * (n + k) + 1 :]
        z = np.column_stack([from_coordinates(states, n, k), found[:, 2 * (n + k)]])
        return z, from_coordinates(beside, n, k) if linear else None

    def _stepped(self, t: Array, z: Array, rtol: float) -> Array:
        """Step by step where the torque is held, its rate limited, joints stick, or the torque is cut."""
        if self.drive.sample_time is not None:
            return follow_held(self, t, z, rtol)
        if self.drive.rate is not None:
            return follow_slewing(self, t, z, rtol)
        if self.friction is not None:
            return follow_sticking(self, t, z, rtol)
        return follow_cut(self, t, z, rtol)

    @lazy
    def _collocation(self) -> Equations:
        return with_controller(self._equations_under(self._law.direct), self._law)

    def _equations_under(self, law: Law) -> NonlinearEquations:
        """The equations of the arm under a law without a controller."""
        return NonlinearEquations(self.lin, law)

    def _collocated(self, t: Array, start: Array, rtol: float, stages: int, linear: bool, trail: Trail | None) -> Array:
        """The smooth loop. Raises: TorqueCut where the drive does not give the torque that is commanded."""
        marks, limit = with_breaks(t[[0, -1]], self.lin, self.rough), self.drive.limit
        passed: list[tuple[Array, Array]] = []

        def accept(t: Array, x: Array, torque: Array) -> None:
            if limit is not None and np.any(np.abs(torque) > CLOSE * np.array(limit)):
                raise TorqueCut
            self.accept(t, x)
            passed.append((t, x))
            if len(passed) >= CHECKED:
                self._check_mass(passed)

        watched = None if self.layers is None else partial(hurries, self.layers)
        integrator = Collocation(self._collocation, self.lin.period, stages, max(rtol, ROUNDING), accept, watched)
        try:
            found, self.trail = integrator.integrate(t, to_coordinates(start, self.n), marks, linear, trail)
            return found
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


def follow_cut(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) of a loop whose torque is cut, by a multistep method, which bears corners."""
    from scipy.integrate import LSODA

    def follow(now: float, z: Array) -> Array:
        asked = loop.law(now, z[:-1])
        given = loop.drive.saturated(asked)
        return loop.rate(now, z, given, loop.law.rate(now, z[:-1], asked - given))

    def make(now: float, z: Array, first: float | None, end: float) -> "LSODA":
        return LSODA(follow, now, z, end, first_step=first, rtol=rtol, atol=rtol * 1e-2)

    out, marks, aside = [z[None]], with_breaks(t[[0, -1]], loop.lin, loop.rough), INSIDE * loop.lin.period
    for begin, end in pairwise(marks):
        first, last, stops = begin + aside, end - aside, t[(t > begin) & (t <= end)]
        stops = np.clip(stops, first, last)
        z, values = march(
            partial(make, end=last), z, first, last, stops, loop.accept, partial(skips_layer, loop.layers)
        )
        out.append(values)
    return np.concatenate(out)


def follow_sticking(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) of a loop whose joints stick and slide, from event to event; the loop's `events` are set."""

    def torque(now: float, z: Array) -> tuple[Array, Array]:
        asked = loop.law(now, z[:-1])
        given = loop.drive.saturated(asked)
        return given, loop.law.rate(now, z[:-1], asked - given)

    joints = Sticking(loop, torque)
    out = joints.follow(t, joints.begin(float(t[0]), z), rtol)
    loop.events = tuple(joints.events)
    return out


def follow_slewing(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) of a loop whose drive changes its torque at a limited rate; the loop's `given` torques are set."""
    out, loop.given = Slewing(loop, np.array(loop.drive.rate)).run(t, z, rtol)
    return out


def follow_held(loop: ControlledArm, t: Array, z: Array, rtol: float) -> Array:
    """States (N, 2n + k + 1) from instant to instant at which the torque changes, sampling measured `delay` before.

    The controller's own states move from sample to sample, as what was measured and asked at the first of them has it. The loop's `given`
    torques are set.
    """
    step, delay = loop.drive.sample_time or 1.0, loop.drive.delay
    law, plant = loop.law, 2 * loop.n
    held = None if law.controller is None else hold_controller(law.controller.rates, step)
    out, torque = np.empty((len(t), len(z))), loop.command(t[0], loop.measure(t[0], z[:-1]))
    out[0], now, done, sample = z, float(t[0]), 1, 0
    loop.given = np.tile(torque, (len(t), 1))
    while done < len(t):
        measured = t[0] + sample * step
        seen = loop.measure(measured, z[:-1])
        asked = law(measured, seen)
        given, after = loop.drive.saturated(asked), z[plant:-1]
        if held is not None:
            after = after + held @ law.rate(measured, seen, asked - given)
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
