"""Periodic solutions of the full nonlinear equations near the rigid motion, by harmonic balance at equally spaced times."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.linear import Linearization, along_motion, feedback_gains
from flexlin.checks import Array, positive
from flexlin.errors import MotionError, NumericalError, ToleranceNotReached
from flexlin.motion import SymbolicMotion
from flexlin.periodic.fourier import FourierSeries, fourier_differentiation
from flexlin.periodic.system import MatrixFunction

POINTS = (33, 65, 129, 257, 513)
NEWTON_STEPS = 25


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The symbols that a closing condition is written in: y, y', torque (unknown); gain (m, 2n), rigid torque, s and s_R (given)."""

    y: ca.SX
    y_rate: ca.SX
    torque: ca.SX
    gain: ca.SX
    rigid_torque: ca.SX
    s: ca.SX
    rigid: ca.SX


Closing = Callable[[Linearization, Unknowns], ca.SX]
"""What determines the torque: m expressions that vanish."""


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A periodic solution s = s_R + y of M s'' + C s' + g + d = B torque.

    Call it with times (N,) to get y (N, n); `rate`, `acceleration` and `torque` likewise; `state` gives [y; y'].
    `error` is the difference to the solution on half as many points, relative to the largest |y|.
    """

    lin: Linearization
    y: FourierSeries
    torque: FourierSeries
    error: float
    status: str

    def __call__(self, t: Array) -> Array:
        return self.y(t)

    def rate(self, t: Array) -> Array:
        """y' at times (N,)."""
        return self.y(t, 1)

    def acceleration(self, t: Array) -> Array:
        """y'' at times (N,)."""
        return self.y(t, 2)

    def state(self, t: Array) -> Array:
        """[y; y'] at times (N,): (N, 2n)."""
        return np.concatenate([self.y(t), self.y(t, 1)], axis=1)


def rigid_feedforward(lin: Linearization, at: Unknowns) -> ca.SX:
    """torque = tau_R - gain [y; y']: the closed loop about the rigid motion, with the torque of the rigid motion."""
    return at.torque - at.rigid_torque + at.gain @ ca.vertcat(at.y, at.y_rate)


def pure_feedback(lin: Linearization, at: Unknowns) -> ca.SX:
    """torque = -gain [y; y']: the closed loop without feedforward."""
    return at.torque + at.gain @ ca.vertcat(at.y, at.y_rate)


def periodic_motion(
    lin: Linearization,
    closing: Closing | None = None,
    gain: MatrixFunction | None = None,
    tol: float = 1e-8,
    linear: bool = False,
) -> PeriodicMotion:
    """Find the periodic motion of the elastic arm that a closing condition singles out.

        M(s) s'' + C s' + g + d = B torque,   closing(y, y', torque, t) = 0,   s = s_R + y,   y(t + T) = y(t)

    y and torque are trigonometric polynomials; the equations hold at N equally spaced times (Newton's method on all at once).
    As a boundary value problem it does not mind unstable modes, of the plant or of its zeros.
    Assumes a smooth motion: at a jump of q''' the series converges slowly, which the error shows.

    Parameters: closing: default is the loop that `lin` was closed with; gain: (N,) -> (N, m, 2n), default the scene's feedback;
    tol: wished `error`; linear: stop after one Newton step from the rigid motion, the answer of the linearization.
    Returns: a `PeriodicMotion`.
    Raises: MotionError for a one-way motion; NumericalError when Newton's method fails; ToleranceNotReached.
    Source: Krack, Gross, Harmonic Balance for Nonlinear Vibration Problems (2019), ch. 2.
    """
    positive("tol", tol)
    if not lin.motion.periodic:
        raise MotionError("a one-way motion has no periodic solution", todo="use course = 'there-and-back'")
    closing = default_closing(lin) if closing is None else closing
    equations = balance(lin, closing)
    gain = constant(own_gain(lin)) if gain is None else gain
    before: FourierSeries | None = None
    for points in POINTS:
        y, torque = solve_at(lin, equations, gain, points, linear, before)
        if before is not None:
            t = lin.period * np.arange(2 * points) / (2 * points)
            size = np.abs(y.values).max() or 1.0
            error = float(np.abs(y(t) - before(t)[:, : lin.n]).max() / size)
            if error <= tol:
                return PeriodicMotion(lin, y, torque, error, f"converged on {points} points")
        before = FourierSeries.through(np.concatenate([y.values, torque.values], axis=1), lin.period)
    if error > 0.01:
        raise ToleranceNotReached(
            "the periodic motion is not resolved",
            got=f"error {error:.2g} on {POINTS[-1]} points",
            expected=f"at most {tol:.2g}",
            todo="use a smoother basic motion",
        )
    todo = "the motion is not smooth; choose a smoother one, or a tol above this error"
    return PeriodicMotion(
        lin, y, torque, error, f"error {error:.1e} above tol {tol:.0e} on {POINTS[-1]} points: {todo}"
    )


def default_closing(lin: Linearization) -> Closing:
    """The loop that the linearization was closed with."""
    return pure_feedback if lin.control is not None and lin.control.feedforward == "none" else rigid_feedforward


def balance(lin: Linearization, closing: Closing) -> ca.Function:
    """All equations F of one time, and their Jacobians by y, y', y'' and torque."""
    arm, kept, driven = lin.arm, list(lin.kept), list(lin.driven)
    n, m, E = lin.n, len(driven), arm.reference
    y, y_rate, y_acceleration = (ca.SX.sym(name, n) for name in ("y", "y1", "y2"))
    torque, gain, angles = ca.SX.sym("torque", m), ca.SX.sym("gain", m * 2 * n), ca.SX.sym("angles", 3 * arm.joints)
    select = ca.DM.eye(arm.n)[:, kept]
    rigid = [ca.densify(E @ part) for part in ca.vertsplit(angles, arm.joints)]
    moved = [part + select @ extra for part, extra in zip(rigid, (y, y_rate, y_acceleration), strict=True)]
    full, inputs = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot), arm.B[:, driven]
    left, B = ca.substitute([arm.residual, inputs], [full], [ca.densify(ca.vertcat(*moved))])
    on_motion, rigid_inputs = ca.substitute([arm.residual, inputs], [full], [ca.densify(ca.vertcat(*rigid))])
    project = E[:, driven].T
    rigid_torque = ca.solve(project @ rigid_inputs, project @ on_motion) if m else ca.SX(0, 1)
    at = Unknowns(y, y_rate, torque, ca.reshape(gain, m, 2 * n), rigid_torque, moved[0], rigid[0])
    F = ca.vertcat((left - B @ torque)[kept], closing(lin, at))
    outputs = {"F": F} | {
        name: ca.jacobian(F, by) for name, by in (("K", y), ("D", y_rate), ("M", y_acceleration), ("T", torque))
    }
    named = {"y": y, "y1": y_rate, "y2": y_acceleration, "torque": torque, "gain": gain}
    return along_motion(arm, lin.motion, angles, named, outputs)


def solve_at(
    lin: Linearization,
    equations: ca.Function,
    gain: MatrixFunction,
    points: int,
    linear: bool,
    start: FourierSeries | None,
) -> tuple[FourierSeries, FourierSeries]:
    """Solve the equations at N times by Newton's method, from the rigid motion or from a coarser solution."""
    n, m, T = lin.n, len(lin.driven), lin.period
    t = T * np.arange(points) / points
    first = fourier_differentiation(points, T)
    second = first @ first
    gains = np.swapaxes(gain(t), 1, 2).reshape(points, -1)
    place = place_on_motion(lin, t)
    z = np.zeros((points, n + m)) if start is None or linear else start(t)
    for _ in range(NEWTON_STEPS):
        y = z[:, :n]
        F, K, D, M, by_torque = symbolic.evaluate(equations, y, first @ y, second @ y, z[:, n:], gains, *place)
        J = np.zeros((points, n + m, points, n + m))
        J[:, :, :, :n] = np.einsum("jab,jk->jakb", D, first) + np.einsum("jab,jk->jakb", M, second)
        j = np.arange(points)
        J[j, :, j, :n] += K
        J[j, :, j, n:] += by_torque
        step = np.linalg.solve(J.reshape(z.size, z.size), F.reshape(-1)).reshape(z.shape)
        z = z - step
        if linear or np.abs(step[:, :n]).max() <= 1e-11 * max(np.abs(z[:, :n]).max(), 1e-12):
            return FourierSeries.through(z[:, :n], T), FourierSeries.through(z[:, n:], T)
        if not np.all(np.abs(z) < 1e8):
            break
    raise NumericalError(
        "no periodic motion was found near the rigid one",
        got=f"Newton's method did not settle in {NEWTON_STEPS} steps",
        todo="slow the motion down, lower its amplitude or stiffen the feedback",
    )


def place_on_motion(lin: Linearization, t: Array) -> list[Array]:
    """The arguments that `along_motion` functions take after their own: the place on the motion, and the parameters."""
    motion, values = lin.motion, lin.arm.parameters.values
    where = [motion.phase_of(t)[:, None]] if isinstance(motion, SymbolicMotion) else list(motion.sample(t))
    return [*where, np.broadcast_to(values, (len(t), len(values)))]


def own_gain(lin: Linearization) -> Array:
    """The scene's feedback as a matrix (m, 2n); zero when there is none."""
    if lin.control is None:
        return np.zeros((len(lin.driven), 2 * lin.n))
    kept = list(lin.kept)
    kp, kd = feedback_gains(lin.arm, list(lin.driven), lin.control)
    return ca.DM(ca.densify(ca.horzcat(kp[:, kept], kd[:, kept]))).full()


def constant(matrix: Array) -> MatrixFunction:
    """A constant as a function of time."""
    return lambda t: np.broadcast_to(matrix, (len(t), *matrix.shape))
