"""The nonlinear equations of motion under a control law, integrated by collocation: as a whole, or from event to event."""

from functools import partial

import numpy as np

from flexlin.checks import Array
from flexlin.errors import SimulationStopped
from flexlin.lazy import lazy
from flexlin.linearization.law import Law
from flexlin.linearization.layers import Layers
from flexlin.linearization.linearization import Linearization
from flexlin.precision import SLIGHT
from flexlin.simulation.collocation import LEAST_RUN_TOL, Collocation
from flexlin.simulation.drive import Drive
from flexlin.simulation.equations import ModedEquations, NonlinearEquations
from flexlin.simulation.events import Events, Samples
from flexlin.simulation.mesh import Trail, find_rough_times, law_times, mark_times
from flexlin.simulation.modes import Friction
from flexlin.simulation.result import LARGEST_DEVIATION, PEAK_PARTS
from flexlin.simulation.stopping import explain_end, find_indefinite, name_largest, stopped
from flexlin.simulation.window import Grid, Path, between

NEAR_LIMIT = 1 - SLIGHT
"""A torque nearer to its limit than this, at any stage of the collocation, may be cut between the stages."""
SWITCHED_SHARE = 1 / 16
"""Of the tolerance, where torques switch: events are found on the polynomials between the stages, of lower order than the steps' ends."""
CHECKED_WINDOWS = 64
"""Windows after which the mass matrices of the states that they reached are looked at, all in one call."""


class TorqueCut(Exception):
    """The drive does not give the torque that the law commands."""


class NonlinearLoop:
    """The nonlinear equations in the deviation x = [y; y'] from the rigid motion; the last state is the work done on the arm.

        M y'' = B torque - (M s_R'' + C s' + g + d),   work' = s' (M s'' + C s' + g)

    They are integrated as a whole while the drive gives what is commanded, else from event to event. The k states z of a law's
    controller, where it has any, follow those of the arm: x = [y; y'; z].

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
        self.friction, self.events = Friction.of(lin), tuple[tuple[float, str, str], ...]()
        self.given: Array | None = None
        self.reached = list[float]()
        self.trail: Trail | None = None
        self._cut = False

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
        return self.drive.saturated(self._law.torque(law_times(self.lin, t), x))

    def accept(self, t: Array, z: Array) -> None:
        """Look at states that were reached.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.
        z : array, shape (N, k)
            States; the first n of each are y.

        Raises
        ------
        SimulationStopped
            When the loop diverges.
        """
        self.reached.extend(t.tolist())
        deviations = np.abs(z[:, : self.n])
        inside = deviations.max(axis=1, initial=0.0) < LARGEST_DEVIATION
        if not inside.all():
            first = int(np.argmin(inside))
            where = name_largest(self.lin, deviations[first])
            now = float(t[first])
            raise SimulationStopped(
                f"the nonlinear simulation makes no headway at t = {now:.4g} s",
                got=f"a state {where} off the rigid motion",
                todo="the loop diverges or is very stiff: lower the gains, slow the motion down, or simulate fewer periods",
                t=now,
                left_range=True,
            )

    @lazy
    def rough(self) -> Array:
        """Times in [0, T) that no step passes over: breaks and narrow features of the motion, and where the law changes fast."""
        return find_rough_times(self._law, self.lin)

    @lazy
    def layers(self) -> Layers | None:
        """Where resisting forces saturate; joints that stick are found by events."""
        return Layers.of(self.lin.about) if self.friction is None else None

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
            Of the collocation.

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
        self.reached = []
        self.accept(t[:1], start[None])
        try:
            if not (self._cut or self.friction or self.drive.rate or self.drive.sample_time):
                try:
                    return self._collocated(t, start, rtol, stages, linear, trail)
                except TorqueCut:
                    self._cut, self.reached = True, self.reached[:1]
            return self._switched(t, start, SWITCHED_SHARE * rtol, stages), None
        except SimulationStopped as end:
            raise (explain_end(self.lin, end) if end.reached is not None else end) from None

    def _equations_under(self, law: Law) -> NonlinearEquations:
        """The equations of the loop."""
        return NonlinearEquations(self.lin, law)

    def _collocated(
        self, t: Array, start: Array, rtol: float, stages: int, linear: bool, trail: Trail | None
    ) -> tuple[Array, Array | None]:
        """The smooth loop. Raises: TorqueCut where the drive does not give the torque that is commanded."""
        equations = self._equations_under(self._law)
        z, beside, self.trail = self._integrate(equations, t, start, rtol, stages, None, linear, trail)
        return z, beside

    def _switched(self, t: Array, start: Array, rtol: float, stages: int) -> Array:
        """From event to event and from sample to sample, in a mode at a time."""
        law, sampled = self._law, self.drive.sample_time is not None
        events = (Samples if sampled else Events)(self.lin, law, self.drive, self.friction)
        arm = ModedEquations(self.lin, law.direct if sampled else law, events.modes, self.friction)
        start = events.begin(float(t[0]), start)[: 2 * self.n + arm.k]
        z, *_ = self._integrate(arm, t, start, rtol, stages, events)
        if isinstance(events, Samples):
            z = np.column_stack([z[:, :-1], events.memory(t), z[:, -1]])
        self.events = tuple(events.notes)
        self.given = events.torques(t, law.torque(law_times(self.lin, t), z[:, :-1]))
        return z

    def _integrate(
        self,
        equations: NonlinearEquations,
        t: Array,
        start: Array,
        rtol: float,
        stages: int,
        events: Events | None,
        linear: bool = False,
        trail: Trail | None = None,
    ) -> tuple[Array, Array | None, Trail | None]:
        """States by collocation, each looked at once it is reached."""
        ends, limit = t[[0, -1]], self.drive.limit
        if isinstance(events, Samples):
            ends = np.union1d(ends, events.instants(float(t[-1])))
        marks, narrow = mark_times(ends, self.lin, self.rough)
        passed: list[tuple[Array, Array]] = []

        def accept(t: Array, x: Array, torque: Array) -> None:
            if events is None and limit is not None and np.any(np.abs(torque) > NEAR_LIMIT * np.array(limit)):
                raise TorqueCut
            self.accept(t, x)
            passed.append((t, x))
            if len(passed) >= CHECKED_WINDOWS:
                self._check_mass(passed)

        watched = None if self.layers is None else partial(hurries, self.layers)
        tol = max(rtol, LEAST_RUN_TOL)
        integrator = Collocation(equations, self.lin.period, stages, tol, accept, watched, events)
        try:
            return integrator.integrate(t, start, marks, narrow, linear, trail)
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


def hurries(layers: Layers, grid: Grid, path: Path) -> Array:
    """`Layers.hurry` of the steps (K,) of a window; coordinates of a controller stand behind those of the arm."""
    t, n = grid.edges[:-1, None] + grid.h[:, None] * np.linspace(0, 1, PEAK_PARTS + 1), layers.about.n
    x = between(grid, path, np.zeros((grid.count, grid.stages)), t.ravel())[0].reshape(*t.shape, -1)
    return layers.hurry(t, x[..., :n], x[..., x.shape[-1] // 2 :][..., :n])
