"""The bridge: a manipulator linearized along its rigid basic motion, M_L y'' + D_L y' + K_L y = h_L + B_L u."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array, instance, times
from flexlin.errors import ArgumentError, InputError, ModelError, MotionError
from flexlin.kronecker import derivative
from flexlin.mechanics.coordinates import Coordinate
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion, SymbolicMotion, build_motion
from flexlin.periodic.companion import build_companion, build_input
from flexlin.periodic.system import PeriodicSystem, SecondOrder
from flexlin.scene.control import Control
from flexlin.scene.motion import AnyMotion, MotionTable

Route = Literal["jacobian", "kronecker"]


@dataclass(frozen=True)
class Coefficients:
    """M_L, D_L, K_L (N, n, n), h_L (N, n), B_L (N, n, m) and the feedforward torque of the rigid motion tau (N, m), at N times."""

    M: Array
    D: Array
    K: Array
    h: Array
    B: Array
    tau: Array


@dataclass(frozen=True, eq=False)
class Linearization:
    """The linear equations of the small motion y about the rigid basic motion s_R.

        M_L(t) y'' + D_L(t) y' + K_L(t) y = h_L(t) + B_L(t) u,     s = s_R + y

    Without a loop h_L = -(M s_R'' + C s_R' + g + d) and u is the whole torque. With a loop, torque = feedforward + feedback + u:
    D_L and K_L hold the feedback, h_L the feedforward.

    `M(t)`, `D(t)`, `K(t)` (N, n, n), `h(t)` (N, n), `B(t)` (N, n, m) take times t (N,) in s; all are evaluated in one mapped call.
    """

    arm: Manipulator
    motion: Motion
    kept: tuple[int, ...]
    driven: tuple[int, ...]
    coefficients: ca.Function
    route: Route
    control: Control | None = None
    _last: list[tuple[Array, Coefficients]] = field(default_factory=list, init=False, repr=False)

    @property
    def period(self) -> float:
        """The period of the basic motion, in s."""
        return self.motion.period

    @property
    def n(self) -> int:
        """The number of coordinates of the linear equations."""
        return len(self.kept)

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """What each coordinate of y is."""
        return tuple(self.arm.coordinates[k] for k in self.kept)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates y."""
        return tuple(self.arm.names[k] for k in self.kept)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the coordinates that the inputs drive."""
        return tuple(self.arm.names[self.arm.drives[i]] for i in self.driven)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in [0, T) at which the coefficients lose smoothness."""
        return self.motion.breaks

    def sample(self, t: Array) -> Coefficients:
        """All coefficients at the times t (N,), in one mapped call; the last answer is kept, since A and B are asked for in turn."""
        t = times(t)
        if self._last and np.array_equal(self._last[0][0], t):
            return self._last[0][1]
        p = np.broadcast_to(self.arm.parameters.values, (len(t), len(self.arm.parameters.values)))
        if isinstance(self.motion, SymbolicMotion):
            values = symbolic.evaluate(self.coefficients, self.motion.phase_of(t)[:, None], p)
        else:
            values = symbolic.evaluate(self.coefficients, *self.motion.sample(t), p)
        M, D, K, h, B, tau = values
        found = Coefficients(M, D, K, h[:, :, 0], B, tau[:, :, 0])
        self._last[:] = [(t.copy(), found)]
        return found

    def M(self, t: Array) -> Array:
        """The mass matrix, Eq. (65)."""
        return self.sample(t).M

    def D(self, t: Array) -> Array:
        """The matrix of y', Eq. (66)."""
        return self.sample(t).D

    def K(self, t: Array) -> Array:
        """The matrix of y, Eq. (67)."""
        return self.sample(t).K

    def h(self, t: Array) -> Array:
        """The forcing that the rigid motion leaves over, Eq. (64)."""
        return self.sample(t).h

    def B(self, t: Array) -> Array:
        """The input matrix."""
        return self.sample(t).B

    def feedforward(self, t: Array) -> Array:
        """The torque of the rigid motion, (N, m) in N m: what the arm would need if its links were rigid."""
        return self.sample(t).tau

    def periodic_system(self) -> PeriodicSystem:
        """The linear system x' = A(t) x + B(t) u with x = [y; y'].

        Raises: MotionError for a one-way motion, which has no period.
        """
        self._need_period()
        second_order = SecondOrder(self.M, self.D, self.K, self.B, self._together)
        return PeriodicSystem(self._state_matrix, self.period, self._input_matrix, self.motion.breaks, second_order)

    def forcing(self, t: Array) -> Array:
        """M_L^-1 h_L in state form, (N, 2n): x' = A x + forcing."""
        c = self.sample(t)
        return build_input(c.M, c.h[:, :, None], t)[:, :, 0]

    def _together(self, t: Array) -> tuple[Array, Array, Array]:
        c = self.sample(t)
        return c.M, c.D, c.K

    def _state_matrix(self, t: Array) -> Array:
        c = self.sample(t)
        return build_companion(c.M, c.D, c.K, t)

    def _input_matrix(self, t: Array) -> Array:
        c = self.sample(t)
        return build_input(c.M, c.B, t)

    def _need_period(self) -> None:
        if not self.motion.periodic:
            raise MotionError(
                "a one-way motion has no period",
                got="course = 'one-way'",
                expected="a periodic basic motion",
                todo="use course = 'there-and-back', or a finite-horizon design",
            )


def linearize(
    arm: Manipulator, motion: AnyMotion | Motion, control: Control | None = None, *, route: Route = "jacobian"
) -> Linearization:
    """Linearize a manipulator along its rigid basic motion.

        M_L y'' + D_L y' + K_L y = h_L + B_L u,    M_L = M,
        D_L = C + dC/ds' (s_R' (x) E) + dd/ds',    K_L = dM/ds (s_R'' (x) E) + dC/ds (s_R' (x) E) + d(g + d)/ds,
        h_L = tau - (M s_R'' + C s_R' + g + d),    all at s_R = E_q q, elastic coordinates at rest.

    A prescribed joint is no coordinate: its row and column are left out. With `control`, the scene's loop is closed.

    Assumes small y: the quadratic terms are left out.

    Parameters: motion: a scene's motion table, or a `Motion`; route: "jacobian" differentiates the residual M s'' + C s' + g + d
    (cheapest), "kronecker" writes the equations above in Kronecker layout.
    Returns: a `Linearization`.
    Raises: MotionError when the motion does not fit; ArgumentError for an unknown route or gains that do not fit;
    ModelError when a coefficient is not finite along the motion.
    Source: Khang, Dat, Tuan (2019), Eqs (60)-(67).
    """
    instance("arm", arm, Manipulator, "make one: fl.build_manipulator(scene), or Manipulator.from_matrices(...)")
    if not isinstance(motion, Motion):
        instance("motion", motion, MotionTable, "give scene.motion, or what build_motion makes")
        motion = build_motion(motion, arm.joints, arm.parameters)
    if motion.joints != arm.joints:
        raise MotionError("the motion has the wrong number of joints", got=motion.joints, expected=str(arm.joints))
    routes: dict[str, Callable[[Manipulator], tuple[ca.SX, ca.SX, ca.SX]]] = {
        "jacobian": by_jacobian,
        "kronecker": by_kronecker,
    }
    if route not in routes:
        raise ArgumentError("there is no such route", got=repr(route), expected=" or ".join(routes))
    driven = [i for i in range(arm.joints) if not motion.prescribed[i]]
    kept = [k for k in range(arm.n) if k not in {arm.drives[i] for i in range(arm.joints) if motion.prescribed[i]}]
    if not kept:
        raise InputError(
            "nothing is left to move", got="every coordinate prescribed", expected="a link with modes or a driven joint"
        )
    angles, outputs = _along(arm, routes[route](arm), kept, driven, control)
    coefficients = along_motion(arm, motion, angles, {}, outputs)
    lin = Linearization(arm, motion, tuple(kept), tuple(driven), coefficients, route, control)
    _need_finite(lin)
    return lin


def _need_finite(lin: Linearization, phases: int = 33) -> None:
    """Raise when a coefficient leaves the real numbers along the motion, naming the entry and the time."""
    t = np.linspace(0, lin.period, phases)
    c = lin.sample(t)
    for name, values in (("M", c.M), ("D", c.D), ("K", c.K), ("h", c.h), ("B", c.B)):
        if not np.all(np.isfinite(values)):
            k, *entry = np.argwhere(~np.isfinite(values))[0].tolist()
            raise ModelError(
                f"{name}_L{entry} is not finite along the motion, at t = {t[k]:.6g} s",
                got=values[(k, *entry)],
                expected="a finite number",
                todo="keep the motion inside the model's range",
            )


def by_jacobian(arm: Manipulator) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M_L, D_L, K_L as Jacobians of the residual by s'', s' and s."""
    jacobian = partial(ca.jacobian, arm.residual)
    return jacobian(arm.s_ddot), jacobian(arm.s_dot), jacobian(arm.s)


def by_kronecker(arm: Manipulator) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M_L, D_L, K_L by Eqs (65)-(67) in the Kronecker layout, with the dissipation's slopes added."""
    eye, C = ca.DM.eye(arm.n), arm.C
    by_rate, by_acceleration = ca.kron(arm.s_dot, eye), ca.kron(arm.s_ddot, eye)
    D = C + derivative(C, arm.s_dot) @ by_rate + derivative(arm.damping, arm.s_dot)
    K = (
        derivative(arm.M, arm.s) @ by_acceleration
        + derivative(C, arm.s) @ by_rate
        + derivative(arm.g + arm.damping, arm.s)
    )
    return arm.M, D, K


def _along(
    arm: Manipulator, matrices: tuple[ca.SX, ca.SX, ca.SX], kept: list[int], driven: list[int], control: Control | None
) -> tuple[ca.SX, dict[str, ca.SX]]:
    """Set s = E_q q, s' = E_q q', s'' = E_q q'' and leave out what is prescribed; returns [q; q'; q''] and all outputs."""
    angles = ca.SX.sym("angles", 3 * arm.joints)
    rigid = ca.densify(ca.vertcat(*[arm.reference @ part for part in ca.vertsplit(angles, arm.joints)]))
    full = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    M, D, K, left, B = ca.substitute([*matrices, arm.residual, arm.B], [full], [rigid])
    E, inputs = arm.reference[:, driven], B[:, driven]
    tau = ca.solve(E.T @ inputs, E.T @ left) if driven else ca.SX(0, 1)
    if control is not None:
        if control.feedforward == "rigid":
            left -= inputs @ tau
        kp, kd = feedback_gains(arm, driven, control)
        D, K = D + inputs @ kd, K + inputs @ kp
    M, D, K = M[kept, kept], D[kept, kept], K[kept, kept]
    return angles, {"M": M, "D": D, "K": K, "h": -left[kept], "B": inputs[kept, :], "tau": tau}


def feedback_gains(arm: Manipulator, driven: list[int], control: Control) -> tuple[ca.SX, ca.SX]:
    """The scene's feedback u = -kp y - kd y' as matrices (m, n) over all coordinates.

    Raises: ArgumentError when there is not one gain for each torque-driven joint.
    """
    kp, kd = ca.SX(len(driven), arm.n), ca.SX(len(driven), arm.n)
    if control.feedback is None:
        return kp, kd
    for name, matrix, gains in (("kp", kp, control.feedback.kp), ("kd", kd, control.feedback.kd)):
        if len(gains) != len(driven):
            raise ArgumentError(
                f"{name} does not fit the arm",
                got=f"{len(gains)} gains",
                expected=f"{len(driven)} torque-driven joints",
            )
        for row, joint in enumerate(driven):
            matrix[row, :] = gains[row] * arm.encoders[joint, :]
    return kp, kd


def along_motion(
    arm: Manipulator, motion: Motion, angles: ca.SX, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]
) -> ca.Function:
    """A function of `inputs`, the place on the motion, and the free parameters.

    The place is the phase, or q, q', q'' for a motion that is given by numbers; `angles` are the symbols [q; q'; q''].
    """
    p, values = arm.parameters.symbols, list(outputs.values())
    if isinstance(motion, SymbolicMotion):
        values = ca.substitute(values, [angles, motion.parameters.symbols], [ca.vertcat(*motion.rates), p])
        place = {"phase": motion.phase}
    else:
        place = dict(zip(("q", "q1", "q2"), ca.vertsplit(angles, arm.joints), strict=True))
    named = {**inputs, **place, "p": p}
    return ca.Function(
        "along_motion", list(named.values()), [ca.densify(v) for v in values], list(named), list(outputs)
    )
