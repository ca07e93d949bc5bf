"""The nonlinear equations of motion under a control law, integrated."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.law import Law
from flexlin.about.layers import Layers
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.errors import SimulationStopped
from flexlin.lazy import lazy
from flexlin.simulation.collocation import Collocation
from flexlin.simulation.controlled import from_coordinates, to_coordinates, with_controller
from flexlin.simulation.drive import Drive
from flexlin.simulation.ending import explain_end, name_largest, smallest_masses
from flexlin.simulation.equations import Equations, NonlinearEquations
from flexlin.simulation.friction import Friction, refuse
from flexlin.simulation.layers import hurries
from flexlin.simulation.marks import find_rough_times, with_breaks
from flexlin.simulation.prediction import ROUNDING
from flexlin.simulation.stepping import stopped

if TYPE_CHECKING:
    from flexlin.simulation.acceleration import Acceleration
    from flexlin.simulation.table import LawTable

FARTHEST = 100.0
"""A deviation from the rigid motion, in rad or m, at which a simulation is given up as diverging."""
MOST_CALLS = 1_000_000
"""Evaluations of the equations after which a simulation is given up."""

CLOSE = 0.999
"""A torque nearer to its limit than this, at any stage of the collocation, is integrated as one that is cut."""


class TorqueCut(Exception):
    """The drive does not give the torque that the law commands."""


class NonlinearLoop:
    """The nonlinear equations in the deviation x = [y; y'] from the rigid motion; the last state is the work done on the arm.

        M y'' = B torque - (M s_R'' + C s' + g + d),   work' = s' (M s'' + C s' + g)

    The k states z of a law's controller, where it has any, follow those of the arm: x = [y; y'; z].

    Parameters
    ----------
    lin : Linearization
        The arm and its motion.
    law : Law
        What commands the torque.
    drive : Drive, optional
        Saturation, sampling and delay.

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

    def __init__(self, lin: Linearization, law: Law, drive: Drive | None = None):
        self.lin, self._law = lin, law
        self.about, self.drive, self.n = lin.about, drive or Drive(), lin.n
        self._kept = list(lin.kept)
        self.friction, self.events = Friction.of(lin), tuple[tuple[float, str, str], ...]()
        if self.friction is not None and self.drive.sample_time is not None:
            raise refuse("a sampled drive, [control.sampling]", "a drive that is not sampled")
        if self.friction is not None and self.drive.rate is not None:
            raise refuse("a drive of limited rate, [control.saturation] rate", "a drive that follows at once")
        self.given: Array | None = None
        self._calls = 0

    def command(self, t: float, x: Array) -> Array:
        """Return the torque that the motors give for a state at one time.

        Parameters
        ----------
        t : float
            Time in s.
        x : array, shape (2n + k,)
            State [y; y'; z].

        Returns
        -------
        array, shape (m,)
            The torque, in N m.
        """
        return self.drive.saturated(self.law(t, x))

    def commands(self, t: Array, x: Array) -> Array:
        """Return the torques that the motors give at many times.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.
        x : array, shape (N, 2n + k)
            States [y; y'; z].

        Returns
        -------
        array, shape (N, m)
            Torques in N m (forces in N).
        """
        now = t % self.lin.period if self.lin.motion.periodic else np.minimum(t, self.lin.period)
        return self.drive.saturated(self._law.torque(now, x))

    def rate(
        self, t: float, z: Array, torque: Array, remembered: Array | None = None, slip: Array | None = None
    ) -> Array:
        """Return the rate of z = [y; y'; controller; work] under a torque.

        Parameters
        ----------
        t : float
            Time in s.
        z : array, shape (2n + k + 1,)
            State, with the work in J.
        torque : array, shape (m,)
            The torque, in N m.
        remembered : array, shape (k,), optional
            The rates of the controller's states; zero by default.
        slip : array, shape (p,), optional
            Of joints that stick, 0 where one does and else the sign of its rate; by default their friction is the smooth one.

        Returns
        -------
        array, shape (2n + k + 1,)
            z'.

        Raises
        ------
        TrialLeftRange
            Where the mass matrix is not positive definite: an integrator's trial may come there, an arm does not.
        """
        self._calls += 1
        if self._calls > MOST_CALLS:
            raise self._lost(f"{MOST_CALLS} evaluations of the equations", t)
        x, still = z[: 2 * self.n], np.zeros(self._law.memory)
        acceleration, _, power = self.equations.solve(t, x, torque, slip)
        return np.concatenate([x[self.n :], acceleration, still if remembered is None else remembered, [power]])

    def accept(self, t: float, z: Array) -> None:
        """Look at a state that was reached.

        Parameters
        ----------
        t : float
            Time in s.
        z : array
            State; the first n are y.

        Raises
        ------
        SimulationStopped
            When the loop diverges.
        """
        deviation = np.abs(z[: self.n])
        if not deviation.max(initial=0.0) < FARTHEST:
            raise self._lost(f"a state {name_largest(self.lin, deviation)} off the rigid motion", t, far=True)

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
        self, t: Array, start: Array, rtol: float, stages: int, linear: bool = True
    ) -> tuple[Array, Array | None]:
        """Integrate from a start, and the linear equations on the same steps.

        Parameters
        ----------
        t, start, rtol, stages : array, array, float, int
            As for `integrate`.
        linear : bool
            Whether the linear answer is wanted.

        Returns
        -------
        z : array, shape (N, 2n + k + 1)
            What `integrate` returns.
        x : array, shape (N, 2n + k), or None
            States of the linear equations; none where the torque is held or cut.
        """
        z = np.append(start, 0.0)
        self.accept(t[0], z)
        stepped = any(one is not None for one in (self.drive.sample_time, self.drive.rate, self.friction))
        try:
            if stepped:
                return self._stepped(t, z, rtol), None
            try:
                found = self._collocated(t, start, rtol, stages, linear)
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
        from flexlin.simulation.step_by_step import follow_cut, follow_held, follow_slewing, follow_sticking

        if self.drive.sample_time is not None:
            return follow_held(self, t, z, rtol)
        if self.drive.rate is not None:
            return follow_slewing(self, t, z, rtol)
        if self.friction is not None:
            return follow_sticking(self, t, z, rtol)
        return follow_cut(self, t, z, rtol)

    @property
    def states(self) -> int:
        """The number of states 2n + k of arm and controller."""
        return 2 * self.n + self._law.memory

    @lazy
    def law(self) -> "LawTable":
        """The law as a step-by-step integrator asks for it."""
        from flexlin.simulation.table import LawTable

        return LawTable(self._law, self.lin)

    @lazy
    def equations(self) -> "Acceleration":
        """The equations solved for the acceleration, at one time after another."""
        from flexlin.simulation.acceleration import Acceleration

        return Acceleration(self.lin, self.friction)

    @lazy
    def _collocation(self) -> Equations:
        return with_controller(self._equations_under(self._law.direct), self._law)

    def _equations_under(self, law: Law) -> NonlinearEquations:
        """The equations of the arm under a law without a controller."""
        return NonlinearEquations(self.lin, law)

    @lazy
    def rough(self) -> Array:
        """Times in [0, T) that no step passes over: breaks and narrow features of the motion, and where the law changes fast."""
        return find_rough_times(self._law, self.lin)

    @lazy
    def layers(self) -> Layers | None:
        """Where resisting forces saturate; joints that stick are found by events."""
        return Layers.of(self.lin.about) if self.friction is None else None

    def _collocated(self, t: Array, start: Array, rtol: float, stages: int, linear: bool) -> Array:
        """The smooth loop. Raises: TorqueCut where the drive does not give the torque that is commanded."""
        marks, limit = with_breaks(t[[0, -1]], self.lin, self.rough), self.drive.limit

        def accept(t: Array, x: Array, torque: Array) -> None:
            if limit is not None and np.any(np.abs(torque) > CLOSE * np.array(limit)):
                raise TorqueCut
            for now, state in zip(t, x, strict=True):
                self.accept(now, state)
            self._check_mass(t, x)

        watched = None if self.layers is None else partial(hurries, self.layers)
        integrator = Collocation(self._collocation, self.lin.period, stages, max(rtol, ROUNDING), accept, watched)
        return integrator.integrate(t, to_coordinates(start, self.n), marks, linear)

    def _check_mass(self, t: Array, x: Array) -> None:
        """Raises: SimulationStopped, naming the time, where the mass matrix of a state that was reached is not positive definite."""
        positive = smallest_masses(self.lin, t, x) > 0
        if not positive.all():
            first = int(np.argmin(positive))
            raise stopped(float(t[first]), "the mass matrix is not positive definite there", x[first])

    def _lost(self, got: str, t: float, far: bool = False) -> SimulationStopped:
        return SimulationStopped(
            f"the nonlinear simulation makes no headway at t = {t:.4g} s",
            got=got,
            todo="the loop diverges or is very stiff: lower the gains, slow the motion down, or simulate fewer periods",
            t=t,
            left_range=far,
        )
