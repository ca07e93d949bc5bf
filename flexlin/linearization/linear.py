"""`linearize`: from a manipulator, a motion and perhaps a control law to the linear equations about the motion."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, overload

import casadi as ca
import numpy as np

from flexlin.arguments import checked
from flexlin.errors import ArgumentError, ModelError, MotionError
from flexlin.kronecker.symbolic import derivative
from flexlin.linearization.closed_loops import refuse_open_loops
from flexlin.linearization.deviation import Deviation
from flexlin.linearization.law import Feedback
from flexlin.linearization.linearization import Coefficients, Linearization, Route
from flexlin.linearization.trajectory import Trajectory, linearize_along
from flexlin.mechanics.manipulator import Manipulator
from flexlin.mechanics.validation import TOLERANCE, need_positive
from flexlin.motion import Motion, build_motion
from flexlin.periodic.system import PeriodicSystem
from flexlin.scene.control import Control
from flexlin.scene.motion import AnyMotion
from flexlin.scene.problems import checked_table

__all__ = ["Coefficients", "Linearization", "Trajectory", "linearize"]

AnyBasicMotion = AnyMotion | Motion | Mapping[str, Any]
Matrices = tuple[ca.SX, ca.SX, ca.SX]


def left_side(arm: Manipulator) -> ca.SX:
    """The residual M s'' + C s' + g + d; where loops are closed, with the symbols v of the joints that follow."""
    return arm.residual if arm.loops is None else arm.loops.residual


def by_jacobian(arm: Manipulator) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M_L, D_L, K_L as Jacobians of the residual by s'', s' and s."""
    jacobian = partial(ca.jacobian, left_side(arm))
    K = jacobian(arm.s) if arm.loops is None else arm.loops.slope(arm.s)
    return jacobian(arm.s_ddot), jacobian(arm.s_dot), K


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


ROUTES: dict[str, Callable[[Manipulator], Matrices]] = {"jacobian": by_jacobian, "kronecker": by_kronecker}


@overload
def linearize(arm: ca.Function, motion: Trajectory) -> PeriodicSystem: ...


@overload
def linearize(
    arm: Manipulator,
    motion: AnyBasicMotion,
    control: Control | Mapping[str, Any] | None = None,
    *,
    route: Route = "jacobian",
) -> Linearization: ...


@checked
def linearize(
    arm: Manipulator | ca.Function,
    motion: AnyBasicMotion | Trajectory,
    control: Control | Mapping[str, Any] | None = None,
    *,
    route: Route = "jacobian",
) -> Linearization | PeriodicSystem:
    """Linearize a manipulator along its rigid basic motion, or x' = f(t, x, u) along a trajectory.

        M_L y'' + D_L y' + K_L y = h_L + B_L u,    M_L = M,
        D_L = C + dC/ds' (s_R' (x) E) + dd/ds',    K_L = dM/ds (s_R'' (x) E) + dC/ds (s_R' (x) E) + d(g + d)/ds,
        h_L = tau - (M s_R'' + C s_R' + g + d),    all at s_R = E_q q, elastic coordinates at rest.

    Assumes small y: the quadratic terms are left out. A prescribed joint is no coordinate: its row and column are left out. Coordinates
    that are no joints rest at zero in the rigid motion; what that leaves over stands in h_L.

    Of a function f and a trajectory x*(t), u*(t) it makes y' = A(t) y + B(t) v, x = x* + y, u = u* + v, A = df/dx, B = df/du.

    Parameters
    ----------
    arm : Manipulator, or casadi.Function of x, of (x, u) or of (t, x, u)
        The equations of motion; or f (n, 1), which gives x'.
    motion : Motion, a scene's motion table, or a dict of its keys; with a function a Trajectory
        The rigid basic motion of the joints.
    control : Control, or a dict of its keys, optional
        The scene's control: with it the loop is closed. Its numbers that the arm keeps free (paths below `control.`) stay free.
    route : {"jacobian", "kronecker"}
        "jacobian" differentiates the residual M s'' + C s' + g + d (cheapest), "kronecker" writes the equations above in Kronecker
        layout.

    Returns
    -------
    Linearization, or PeriodicSystem
        The coefficients as functions of time; of a function the system of y with inputs v.

    Raises
    ------
    MotionError
        When the motion does not fit, a loop of the arm does not close along it, or the trajectory does not solve x' = f.
    SceneError
        For a dict that is no motion or control table, naming each key.
    SingularClosure
        When the closure of a loop becomes singular along the motion.
    ArgumentError
        For an unknown route or gains that do not fit.
    ModelError
        When a coefficient is not finite along the motion, or the mass matrix is indefinite.

    References
    ----------
    Khang, Dat, Tuan (2019), Eqs (60)-(67).

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> lin.names, lin.period, lin.M([0.0, 0.5]).shape
    (('q1', 'w11', 'w12'), 2.0, (2, 3, 3))
    >>> fl.floquet(lin.periodic_system(), tol=1e-6).verdict
    'stable'

    A pendulum that is held upright, x' = f(x, u):

    >>> import casadi as ca
    >>> x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    >>> f = ca.Function("f", [x, u], [ca.vertcat(x[1], 9.81 * ca.sin(x[0]) + u)])
    >>> fl.linearize(f, fl.Trajectory(ca.DM([0, 0]), ca.DM([0]), period=1.0)).A(0.0).tolist()
    [[0.0, 1.0], [9.81, 0.0]]
    """
    if isinstance(arm, ca.Function):
        if not isinstance(motion, Trajectory) or control is not None or route != "jacobian":
            expected = "a Trajectory, and neither control nor route"
            todo = "linearize(f, fl.Trajectory(x, u, period=...))"
            raise ArgumentError("a function is linearized along a trajectory", expected=expected, todo=todo)
        return linearize_along(arm, motion)
    if isinstance(control, Mapping):
        control = checked_table(Control, control, "control", "control")
    if isinstance(motion, Trajectory):
        raise ArgumentError(
            "a trajectory belongs to a function", got="a Manipulator", expected="a casadi.Function x' = f"
        )
    if not isinstance(motion, Motion):
        motion = build_motion(motion, arm.joints, arm.parameters, arm)
    if motion.joints != arm.joints:
        raise MotionError("the motion has the wrong number of joints", got=motion.joints, expected=str(arm.joints))
    about = Deviation.of(arm, motion)
    if arm.near.loops is not None:
        refuse_open_loops(about.near)
    lin = Linearization(about, coefficients(about.near, ROUTES[route](arm.near)), route)
    need_sound(lin)
    return lin if control is None else with_control(lin, control)


def with_control(plant: Linearization, control: Control) -> Linearization:
    """The loop of a scene's control on an arm that was linearized without one: nothing is derived again.

    Raises: ArgumentError for gains that do not fit; ModelError when a coefficient is not finite, or the mass matrix is indefinite.
    """
    closed = replace(plant, control=control, feedback=Feedback.of(plant.about, control))
    need_sound(closed, phases=1)  # the arm was looked at already
    return closed


def coefficients(about: Deviation, matrices: Matrices) -> ca.Function:
    """All coefficients of the arm along the rigid motion, rows and columns of y only.

    tau = (E' B)^-1 E' (M s_R'' + C s_R' + g + d),   E: the columns of the driven joints
    """
    arm, kept, driven = about.arm, list(about.kept), list(about.driven)
    *_, angles = about.symbols()
    M, D, K, left, B = about.lift([*matrices, left_side(arm), arm.B], angles)
    inputs = B[:, driven]
    tau, M, D, K = rigid_torque(about, left, inputs), M[kept, kept], D[kept, kept], K[kept, kept]
    values = {"M": M, "D": D, "K": K, "h": -left[kept], "B": inputs[kept, :], "tau": tau}
    return about.function(angles, {}, values)


def rigid_torque(about: Deviation, left: ca.SX, inputs: ca.SX) -> ca.SX:
    """The torque that moves the arm as if its links were rigid, from the left side and the inputs on the rigid motion.

    Raises: ModelError where the inputs cannot lead the joints along a motion.
    """
    project = about.arm.reference[:, list(about.driven)].T
    if not about.m:
        return ca.SX(0, 1)
    led = ca.sparsify(ca.simplify(project @ inputs))
    rank = np.linalg.matrix_rank(np.array(ca.DM(led))) if led.is_constant() else ca.sprank(led)
    if rank < about.m:
        names = ", ".join(about.arm.names[about.arm.drives[i]] for i in about.driven)
        raise ModelError(
            "the inputs cannot lead the joints along a motion",
            got=f"{rank} independent forces on {names}",
            expected=f"{about.m}",
            todo="name in joints= the coordinates that the inputs push; the others rest at zero in the rigid motion",
        )
    return ca.solve(project @ inputs, project @ left)


MOST_NAMED = 3
"""Free numbers that a refusal names with their values: a sweep has few, sensitivities leave all free."""


def need_sound(lin: Linearization, phases: int = 33) -> None:
    """Raise where a coefficient leaves the real numbers along the motion, naming the entry and the time, or M_L is indefinite."""
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
    size = np.sqrt(np.abs(np.einsum("tii->ti", c.M)))
    size[size == 0] = 1.0
    least = np.linalg.eigvalsh(c.M / size[:, :, None] / size[:, None, :])[:, 0]
    if least.min() < -TOLERANCE:  # where it is singular, the coordinates without inertia may yet be left out
        worst = int(np.argmin(least))
        todo = "give links and motors the whole inertia of what moves with them, rotors (effects.rotor_spin) included"
        free = zip(lin.arm.parameters.paths[:MOST_NAMED], lin.arm.parameters.values.tolist(), strict=False)
        where = ", ".join([f"at t = {t[worst]:.6g} s", *(f"{path} = {value:.6g}" for path, value in free)])
        need_positive(c.M[worst], lin.names, where, todo)
