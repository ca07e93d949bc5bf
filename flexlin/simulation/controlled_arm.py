"""The nonlinear arm under a control law and its drive: torques and rates at one time after another, and why a run ended early."""

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flexlin.about.law import Law, is_constant
from flexlin.about.layers import Layers
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.control.sensors import encoder_rows
from flexlin.errors import ArgumentError, SimulationStopped
from flexlin.lazy import lazy
from flexlin.simulation.drive import Drive
from flexlin.simulation.friction import Friction, refuse
from flexlin.simulation.marks import INSIDE, find_rough_times
from flexlin.simulation.mesh import Trail

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline, PPoly

    from flexlin.simulation.friction import Acceleration

KNOTS, MOST_KNOTS = 32, 2**13
"""Between two rough times, at the least and at the most."""
MET = 1e-11
"""Of the law's largest value: what splines may miss midway between their knots."""
FARTHEST = 100.0
"""A deviation from the rigid motion, in rad or m, at which a simulation is given up as diverging."""
MOST_CALLS = 1_000_000
"""Evaluations of the equations after which a simulation is given up."""
SINGULAR = 1e-3
"""The mass matrix of a state is called singular where its smallest eigenvalue has fallen to this share of that on the rigid motion."""


class LawTable:
    """A law as offset(t) - gain(t) x, and the rate of its controller; what varies in time by cubic splines, what is constant as it is.

    sampled: the law is asked for at few times, and may be known at these alone.
    """

    def __init__(self, law: Law, lin: Linearization, sampled: bool = False):
        self._periodic, self._period = lin.motion.periodic, lin.period
        few = lin.period * np.array([0.2, 0.6])
        still = [is_constant(part(few)) for part in (law.forward, law.gain, law.reference)]
        self._gain = law.gain(few)[0] if still[1] else None
        self._offset = law.offset(few)[0] if all(still) else None
        rough = np.empty(0) if sampled else find_rough_times(law, lin)

        def tabulate(f: Callable[[Array], Array]) -> Callable[[float], Array]:
            return (lambda t: f(np.array([t]))[0]) if sampled else tabulated(f, lin, rough)

        self._gains = tabulate(law.gain) if self._gain is None else None
        self._offsets = tabulate(law.offset) if self._offset is None else None
        self.controller, self._steer, self._steers = law.controller, law.steer(law.reference(few))[0], None
        if law.controller is not None and not still[2]:
            self._steers = tabulate(lambda t: law.steer(law.reference(t)))

    def __call__(self, t: float, x: Array) -> Array:
        """The torque (m,) at one time; after the end of a one-way motion the law stays as it is there."""
        t = self._now(t)
        offset = self._offset if self._offsets is None else self._offsets(t)
        gain = self._gain if self._gains is None else self._gains(t)
        return offset - gain @ x

    def rate(self, t: float, x: Array, missing: Array) -> Array:
        """z' (k,) of the controller's states at one time, where `missing` (m,) is the torque that is asked but not given."""
        if self.controller is None:
            return x[:0]
        steer = self._steer if self._steers is None else self._steers(self._now(t))
        return self.controller.rates @ x + steer + self.controller.unwinding @ missing

    def _now(self, t: float) -> float:
        return t % self._period if self._periodic else min(t, self._period)


def tabulated(f: Callable[[Array], Array], lin: Linearization, rough: Array) -> "PPoly":
    """A function over one period by cubic splines between the rough times."""
    from scipy.interpolate import PPoly

    marks = np.unique([0.0, *rough, lin.period])
    scale = float(np.abs(f(lin.period * (np.arange(KNOTS) + 0.5) / KNOTS)).max())
    pieces = [spline(f, begin, end, INSIDE * lin.period, MET * scale) for begin, end in pairwise(marks)]
    coefficients = np.concatenate([piece.c for piece in pieces], axis=1)
    return PPoly(coefficients, np.concatenate([*[piece.x[:-1] for piece in pieces], marks[-1:]]))


def spline(f: Callable[[Array], Array], begin: float, end: float, aside: float, tol: float) -> "CubicSpline":
    """A cubic spline with knots doubled until it meets the function midway between them; looked at no nearer to its ends than `aside`."""
    from scipy.interpolate import CubicSpline

    count = KNOTS
    t = np.linspace(begin, end, count + 1)
    values = f(np.clip(t, begin + aside, end - aside))
    while True:
        found, between = CubicSpline(t, values, axis=0), (t[1:] + t[:-1]) / 2
        there = f(between)
        if np.abs(found(between) - there).max() <= tol or count >= MOST_KNOTS:
            return found
        count *= 2
        values = np.insert(values, np.arange(1, len(t)), there, axis=0)
        t = np.insert(t, np.arange(1, len(t)), between)


class ControlledArm:
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
        self.reached = list[float]()
        self.trail: Trail | None = None
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

    def measure(self, t: float, x: Array) -> Array:
        """Return what encoders of finite steps make of a state; rates are taken as they are.

        Parameters
        ----------
        t : float
            Time in s.
        x : array, shape (2n + k,)
            State [y; y'; z].

        Returns
        -------
        array, shape (2n + k,)
            The state with the encoders' readings rounded.
        """
        if self.drive.encoders is None:
            return x
        now, steps = t % self.lin.period if self.lin.motion.periodic else t, np.array(self.drive.encoders)
        rows, back = self._encoders
        read = self.lin.motion.sample(np.array([now]))[0][0, list(self.lin.driven)] + rows @ x[: self.n]
        missed = steps * np.round(read / steps) - read
        return np.concatenate([x[: self.n] + back @ missed, x[self.n :]])

    @lazy
    def _encoders(self) -> tuple[Array, Array]:
        """The readings of y (m, n), and the least change of y that changes them as asked."""
        rows = encoder_rows(self.lin)
        if len(rows) != len(self.drive.encoders or ()):
            raise ArgumentError(
                "encoders do not fit the arm", got=len(self.drive.encoders or ()), expected=str(len(rows))
            )
        return rows, np.linalg.pinv(rows)

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
        inside = deviations.max(axis=1, initial=0.0) < FARTHEST
        if not inside.all():
            first = int(np.argmin(inside))
            where = name_largest(self.lin, deviations[first])
            raise self._lost(f"a state {where} off the rigid motion", float(t[first]), far=True)

    @property
    def states(self) -> int:
        """The number of states 2n + k of arm and controller."""
        return 2 * self.n + self._law.memory

    @lazy
    def law(self) -> LawTable:
        """The law as a step-by-step integrator asks for it."""
        return LawTable(self._law, self.lin, self.drive.sample_time is not None)

    @lazy
    def equations(self) -> "Acceleration":
        """The equations solved for the acceleration, at one time after another."""
        from flexlin.simulation.friction import Acceleration

        return Acceleration(self.lin, self.friction)

    @lazy
    def rough(self) -> Array:
        """Times in [0, T) that no step passes over: breaks and narrow features of the motion, and where the law changes fast."""
        return find_rough_times(self._law, self.lin)

    @lazy
    def layers(self) -> Layers | None:
        """Where resisting forces saturate; joints that stick are found by events."""
        return Layers.of(self.lin.about) if self.friction is None else None

    def _lost(self, got: str, t: float, far: bool = False) -> SimulationStopped:
        return SimulationStopped(
            f"the nonlinear simulation makes no headway at t = {t:.4g} s",
            got=got,
            todo="the loop diverges or is very stiff: lower the gains, slow the motion down, or simulate fewer periods",
            t=t,
            left_range=far,
        )


def explain_end(lin: Linearization, end: SimulationStopped) -> SimulationStopped:
    """The error with what is found at the state that was reached: how far it is, and whether its mass matrix has become singular.

    The beams' equations hold for small bending. Far out the shortening of a bent link can take more kinetic energy from a body
    behind it than its motion gives, and M(s) loses its definiteness: there the equations end, not the arm.
    """
    t, x = np.array([end.t]), np.asarray(end.reached)[None]
    here, rigid = (float(smallest_masses(lin, t, state)[0]) for state in (x, np.zeros_like(x)))
    where = f"{name_largest(lin, np.abs(x[0, : lin.n]))} off the rigid motion"
    if here <= SINGULAR * rigid:
        got = f"a mass matrix that becomes singular, {where}: the equations, which are those of small bending, have no meaning beyond it"
    else:
        got = f"{end.got}; the state that was reached is {where}, and its mass matrix is sound"
    return SimulationStopped(
        end.what, got=got, todo=end.todo, t=end.t, reached=end.reached, left_range=here <= SINGULAR * rigid
    )


def smallest_masses(lin: Linearization, t: Array, x: Array) -> Array:
    """The smallest eigenvalue of M, scaled to a diagonal of the rigid motion's, at states x (N, 2n) and times t (N,)."""
    kept, both = list(lin.kept), np.concatenate([x[:, : lin.n], np.zeros((len(t), lin.n))])
    M, rigid = np.split(lin.about.of_arm("M", np.concatenate([t, t]), both)[:, kept][:, :, kept], 2)
    scale = 1 / np.sqrt(np.einsum("tii->ti", rigid))
    return np.linalg.eigvalsh(M * scale[:, :, None] * scale[:, None, :])[:, 0]


def find_indefinite(lin: Linearization, t: Array, x: Array) -> int | None:
    """The first of states x (N, 2n) at times t (N,) whose mass matrix is not positive definite."""
    kept = list(lin.kept)
    try:
        np.linalg.cholesky(lin.about.of_arm("M", t, x[:, : lin.n])[:, kept][:, :, kept])
    except np.linalg.LinAlgError:
        positive = smallest_masses(lin, t, x) > 0
        return None if positive.all() else int(np.argmin(positive))
    return None


def name_largest(lin: Linearization, deviation: Array) -> str:
    """The largest of the deviations (n,) in each unit, with its coordinate: 0.41 rad in q1 and 0.22 m in w11."""
    size, units = np.where(np.isnan(deviation), np.inf, deviation), [c.unit for c in lin.coordinates]
    found = []
    for unit in dict.fromkeys(units):
        worst = max((i for i in range(lin.n) if units[i] == unit), key=lambda i: size[i])
        found.append(f"{deviation[worst]:.3g} {unit} in {lin.coordinates[worst].title}")
    return " and ".join(found)
