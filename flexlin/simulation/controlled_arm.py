"""The nonlinear arm under a control law and its drive: torques and rates at one time after another, and why a run ended early."""

import numpy as np

from flexlin.checks import Array
from flexlin.control.sensors import encoder_rows
from flexlin.errors import ArgumentError, SimulationStopped
from flexlin.lazy import lazy
from flexlin.linearization.law import Controller, Law
from flexlin.linearization.layers import Layers
from flexlin.linearization.linearization import Linearization
from flexlin.precision import SLIGHT
from flexlin.simulation.drive import Drive
from flexlin.simulation.mesh import Trail, find_rough_times, law_times
from flexlin.simulation.modes import Friction
from flexlin.simulation.result import LARGEST_DEVIATION

SINGULAR_SHARE = SLIGHT
"""The mass matrix of a state is called singular where its smallest eigenvalue has fallen to this share of that on the rigid motion."""


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
        self.given: Array | None = None
        self.reached = list[float]()
        self.trail: Trail | None = None
        self._cut = False

    def remembered(self, t: float, x: Array, missing: Array) -> Array:
        """Return z' of the controller's states at one time.

        Parameters
        ----------
        t : float
            Time in s.
        x : array, shape (2n + k,)
            State [y; y'; z].
        missing : array, shape (m,)
            Torque that is asked but not given.

        Returns
        -------
        array, shape (k,)
            The rates.
        """
        controller = self.controller
        if controller is None:
            return x[:0]
        steer = self._law.steer(self._law.reference(law_times(self.lin, np.array([t]))))[0]
        return controller.rates @ x + steer + controller.unwinding @ missing

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

    @property
    def controller(self) -> Controller | None:
        """What the law remembers."""
        return self._law.controller

    @lazy
    def rough(self) -> Array:
        """Times in [0, T) that no step passes over: breaks and narrow features of the motion, and where the law changes fast."""
        return find_rough_times(self._law, self.lin)

    @lazy
    def layers(self) -> Layers | None:
        """Where resisting forces saturate; joints that stick are found by events."""
        return Layers.of(self.lin.about) if self.friction is None else None


def explain_end(lin: Linearization, end: SimulationStopped) -> SimulationStopped:
    """The error with what is found at the state that was reached: how far it is, and whether its mass matrix has become singular.

    The beams' equations hold for small bending. Far out the shortening of a bent link can take more kinetic energy from a body
    behind it than its motion gives, and M(s) loses its definiteness: there the equations end, not the arm.
    """
    t, x = np.array([end.t]), np.asarray(end.reached)[None]
    here, rigid = (float(smallest_masses(lin, t, state)[0]) for state in (x, np.zeros_like(x)))
    where = f"{name_largest(lin, np.abs(x[0, : lin.n]))} off the rigid motion"
    if here <= SINGULAR_SHARE * rigid:
        got = f"a mass matrix that becomes singular, {where}: the equations, which are those of small bending, have no meaning beyond it"
    else:
        got = f"{end.got}; the state that was reached is {where}, and its mass matrix is sound"
    return SimulationStopped(
        end.what, got=got, todo=end.todo, t=end.t, reached=end.reached, left_range=here <= SINGULAR_SHARE * rigid
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
