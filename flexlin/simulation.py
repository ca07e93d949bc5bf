"""The judge: the full nonlinear closed loop beside its linear prediction."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dposv

from flexlin import symbolic
from flexlin.checks import Array, positive, real_array
from flexlin.errors import NumericalError, SingularMassMatrix
from flexlin.linearization import Linearization, along_motion, feedback_gains
from flexlin.motion import SymbolicMotion
from flexlin.periodic.collocation import gauss_transitions
from flexlin.periodic.system import solve_mass

if TYPE_CHECKING:
    import xarray

Feedback = Callable[[Array], Array]
FARTHEST = 100.0
"""A deviation from the rigid motion, in rad or m, at which a simulation is given up as diverging."""

MOST_CALLS = 1_000_000
"""Evaluations of the equations after which a simulation is given up."""


@dataclass(frozen=True)
class Simulation:
    """A nonlinear simulation and the linear prediction of the same motion.

    t (N,) in s; nonlinear, linear: deviations from the rigid motion as states [y; y'] (N, 2n); torque (N, m) in N m;
    tip, tip_linear, tip_rigid: positions (N, 2) in m; error: of the nonlinear states, from a second run at a tenth of the tolerance;
    difference: largest distance of the two tips, in m; status: what the difference means.
    """

    names: tuple[str, ...]
    t: Array
    nonlinear: Array
    linear: Array
    torque: Array
    tip: Array
    tip_linear: Array
    tip_rigid: Array
    error: float

    @property
    def difference(self) -> float:
        """The largest distance between the nonlinear and the linear tip, in m."""
        return float(np.linalg.norm(self.tip - self.tip_linear, axis=1).max())

    @property
    def tip_error(self) -> float:
        """The largest distance of the nonlinear tip from the rigid one, in m."""
        return float(np.linalg.norm(self.tip - self.tip_rigid, axis=1).max())

    @property
    def status(self) -> str:
        """How far the linear model can be trusted here, and what to do."""
        share = self.difference / self.tip_error if self.tip_error > 0 else 0.0
        told = f"linear and nonlinear tips differ by {self.difference:.3g} m, {100 * share:.2g} % of the tip error"
        if share > 0.2:
            return (
                f"{told}: beyond the linear model; reduce speed, payload or disturbance, or trust the simulation only"
            )
        return f"{told}: the linear model holds here"

    def dataset(self) -> "xarray.Dataset":
        """All series as an xarray.Dataset."""
        import xarray

        states = [*self.names, *[f"{name}_rate" for name in self.names]]
        series = {
            "nonlinear": (("time", "state"), self.nonlinear),
            "linear": (("time", "state"), self.linear),
            "torque": (("time", "input"), self.torque),
            "tip": (("time", "axis"), self.tip),
            "tip_linear": (("time", "axis"), self.tip_linear),
            "tip_rigid": (("time", "axis"), self.tip_rigid),
        }
        data = xarray.Dataset(series, coords={"time": self.t, "state": states, "axis": ["x", "y"]})
        data["time"].attrs["units"] = "s"
        data.attrs["integration_error"] = self.error
        return data


def simulate(
    lin: Linearization,
    periods: float = 5.0,
    initial: ArrayLike | None = None,
    feedback: Feedback | None = None,
    tol: float = 1e-8,
    points_per_period: int = 128,
) -> Simulation:
    """Integrate the full nonlinear equations under the loop of `lin`, and the linear ones beside them.

        M(s) s'' + C s' + g + d = B (tau_ff(t) + u),   u = -kp (q - q_R) - kd (q' - q_R'),   or u = -feedback(t) [y; y']

    Assumes the loop that `lin` was closed with; prescribed joints follow their angles.

    Parameters: lin: from `linearize(arm, motion, control)`; periods: length of the simulation; initial: deviation [y; y'] (2n,) at t = 0,
    default none: the arm starts on the rigid motion; feedback: gain function (N,) -> (N, m, 2n) in the place of the scene's own feedback.
    Returns: a `Simulation` with its integration error.
    Raises: NumericalError when the integrator cannot go on (a loop that diverges).
    """
    positive("periods", periods)
    n = lin.n
    start = np.zeros(2 * n) if initial is None else real_array("initial", initial, (2 * n,))
    t = np.linspace(0.0, periods * lin.period, int(np.ceil(periods * points_per_period)) + 1)
    loop = NonlinearLoop(lin, feedback)
    nonlinear, finer = (loop.integrate(t, start, rtol) for rtol in (tol, tol / 10))
    error = float(np.abs(nonlinear - finer).max() / max(1.0, np.abs(finer).max()))
    linear = predict(lin, t, start, feedback)
    torque = np.array([loop.evaluate(time, x)[1] for time, x in zip(t, finer, strict=True)])
    tip, tip_linear, tip_rigid = (tip_positions(lin, t, states) for states in (finer, linear, np.zeros_like(finer)))
    return Simulation(lin.names, t, finer, linear, torque, tip, tip_linear, tip_rigid, error)


class NonlinearLoop:
    """The nonlinear equations in the deviation x = [y; y'] from the rigid motion, under a torque law."""

    def __init__(self, lin: Linearization, feedback: Feedback | None):
        self.lin, self.n = lin, lin.n
        self._equations = symbolic.Pointwise(deviation_equations(lin))
        own = own_gain(lin)
        self._gain = (lambda t: own) if feedback is None else (lambda t: feedback(np.array([t]))[0])
        self._calls = 0
        self._forward = lin.control is None or lin.control.feedforward == "rigid"

    def evaluate(self, t: float, x: Array) -> tuple[Array, Array]:
        """The rate x' and the torque at one time."""
        self._calls += 1
        if self._calls > MOST_CALLS:
            raise NumericalError(
                f"the nonlinear simulation makes no headway at t = {t:.4g} s",
                got=f"{MOST_CALLS} evaluations",
                todo="the loop diverges or is very stiff: look at its Floquet verdict, or simulate fewer periods",
            )
        M, B, left, tau = self._equations(x, *self._where(t), self.lin.arm.parameters.values)
        torque = tau[:, 0] * self._forward - self._gain(t) @ x
        _, acceleration, failed = dposv(M, B @ torque - left[:, 0])
        if failed:
            raise SingularMassMatrix(
                f"the mass matrix is no longer positive definite at t = {t:.4g} s",
                got=f"a deviation of {np.abs(x[: self.n]).max():.3g} rad or m",
                expected="small deflections",
                todo="the loop diverges: look at its Floquet verdict, or simulate fewer periods",
            )
        return np.concatenate([x[self.n :], acceleration]), torque

    def integrate(self, t: Array, start: Array, rtol: float) -> Array:
        """States (N, 2n) at the times t."""
        from scipy.integrate import solve_ivp

        result = solve_ivp(
            lambda t, x: self.evaluate(t, x)[0], (t[0], t[-1]), start, "LSODA", t, rtol=rtol, atol=rtol * 1e-2
        )
        if not result.success:
            raise NumericalError(
                f"the nonlinear simulation stopped at t = {result.t[-1] if len(result.t) else 0:.4g} s",
                got=result.message,
                todo="the loop probably diverges: look at its Floquet verdict, or simulate fewer periods",
            )
        return result.y.T

    def _where(self, t: float) -> list[Array]:
        motion, now = self.lin.motion, np.array([t])
        return (
            [motion.phase_of(now)] if isinstance(motion, SymbolicMotion) else [part[0] for part in motion.sample(now)]
        )


def deviation_equations(lin: Linearization) -> ca.Function:
    """M, B, the residual without acceleration, and the rigid torque, as functions of x = [y; y'] and the place on the motion.

    M y'' = B torque - (M s_R'' + C s' + g + d),    s = s_R + y
    """
    arm, kept, driven = lin.arm, list(lin.kept), list(lin.driven)
    select, E = ca.DM.eye(arm.n)[:, kept], arm.reference
    x, angles = ca.SX.sym("x", 2 * lin.n), ca.SX.sym("angles", 3 * arm.joints)
    q, q1, q2 = ca.vertsplit(angles, arm.joints)
    state = ca.densify(ca.vertcat(E @ q + select @ x[: lin.n], E @ q1 + select @ x[lin.n :], E @ q2))
    rigid = ca.densify(ca.vertcat(E @ q, E @ q1, E @ q2))
    full, inputs = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot), arm.B[:, driven]
    M, B, left = ca.substitute([arm.M[kept, kept], inputs[kept, :], arm.residual[kept]], [full], [state])
    on_motion, rigid_inputs = ca.substitute([arm.residual, inputs], [full], [rigid])
    tau = ca.solve(E[:, driven].T @ rigid_inputs, E[:, driven].T @ on_motion) if driven else ca.SX(0, 1)
    return along_motion(lin.arm, lin.motion, angles, {"x": x}, {"M": M, "B": B, "left": left, "tau": tau})


def own_gain(lin: Linearization) -> Array:
    """The scene's own feedback as a matrix (m, 2n) for u = -gain [y; y']."""
    if lin.control is None:
        return np.zeros((len(lin.driven), 2 * lin.n))
    kp, kd = feedback_gains(lin.arm, list(lin.driven), lin.control)
    kept = list(lin.kept)
    return ca.DM(ca.densify(ca.horzcat(kp[:, kept], kd[:, kept]))).full()


def predict(lin: Linearization, t: Array, start: Array, feedback: Feedback | None) -> Array:
    """The linear answer from the same start: forced periodic response and Floquet modes together, (N, 2n).

    The pair [x; 1] obeys a homogeneous equation, so its transition matrices over the output steps carry the forcing too.
    """
    n = 2 * lin.n

    def augmented(times: Array) -> Array:
        c = lin.sample(times)
        A = np.zeros((len(times), n + 1, n + 1))
        A[:, : lin.n, lin.n : n] = np.eye(lin.n)
        stiffness = np.concatenate([c.K, c.D], axis=2)
        if feedback is not None:
            stiffness += c.B @ (feedback(times) - own_gain(lin))
        A[:, lin.n : n] = solve_mass(c.M, np.concatenate([-stiffness, c.h[:, :, None]], axis=2), times)
        return A

    states = [np.append(start, 1.0)]
    for transition in gauss_transitions(augmented, t, stages=6):
        states.append(transition @ states[-1])
    return np.array(states)[:, :n]


def tip_positions(lin: Linearization, t: Array, states: Array) -> Array:
    """World positions of the tip (N, 2) in m for deviations [y; y'] (N, 2n) from the rigid motion."""
    if lin.arm.points is None:
        return np.full((len(t), 2), np.nan)
    s = lin.motion.sample(t)[0] @ lin.arm.reference.full().T
    s[:, list(lin.kept)] += states[:, : lin.n]
    p = np.broadcast_to(lin.arm.parameters.values, (len(t), len(lin.arm.parameters.values)))
    return symbolic.evaluate(lin.arm.functions["points"], s, p)[0][:, :, -1]
