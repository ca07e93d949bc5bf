"""What sensors on the arm see of the state [y; y']: joint angles and rates, bending at a point, position and acceleration of the tip."""

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.linear import Linearization, along_motion
from flexlin.about.periodic_motion import constant, place_on_motion
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.link_shapes import shapes_of
from flexlin.periodic.companion import solve_mass
from flexlin.periodic.system import MatrixFunction
from flexlin.scene.scene import Scene


def joint_angles(lin: Linearization) -> MatrixFunction:
    """What the motors' encoders read: C (m, 2n), constant, in rad."""
    rows = encoder_rows(lin)
    return constant(np.concatenate([rows, np.zeros_like(rows)], axis=1))


def joint_rates(lin: Linearization) -> MatrixFunction:
    """What the motors' tachometers read: C (m, 2n), constant, in rad/s."""
    rows = encoder_rows(lin)
    return constant(np.concatenate([np.zeros_like(rows), rows], axis=1))


def bending(scene: Scene, lin: Linearization, link: int, at: float) -> MatrixFunction:
    """What a strain gauge sees: the curvature w'' of a link, C (1, 2n), constant, in 1/m; times half the thickness it is the strain.

        w''(x) = sum_k X_k''(x / l) / l^2 w_k

    Parameters: link: its number from 0; at: x / l from 0 (joint) to 1 (tip).
    Raises: ArgumentError when the link is rigid or the place is not on it.
    """
    if not 0 <= link < len(scene.links) or scene.links[link].modes == 0:
        raise ArgumentError(
            "there is no flexible link of that number", got=link, expected=f"0 to {len(scene.links) - 1}"
        )
    if not 0 <= at <= 1:
        raise ArgumentError("the place is not on the link", got=at, expected="0 (joint) to 1 (tip)")
    curvature = shapes_of(scene, link).values(np.array([at]), 2)[:, 0] / scene.links[link].length ** 2
    own = [i for i, c in enumerate(lin.coordinates) if c.kind == "elastic" and c.link == link]
    C = np.zeros((1, 2 * lin.n))
    C[0, own] = curvature
    return constant(C)


def tip_position(lin: Linearization) -> MatrixFunction:
    """What a camera sees of the tip beside its rigid path: C(t) (2, 2n), in m."""
    function = tip_slopes(lin)

    def C(t: Array) -> Array:
        by_y, *_ = symbolic.evaluate(function, *place_on_motion(lin, t))
        return np.concatenate([by_y, np.zeros_like(by_y)], axis=2)

    return C


def tip_acceleration(lin: Linearization) -> tuple[MatrixFunction, MatrixFunction]:
    """What an accelerometer in world axes sees beside the rigid motion: C(t) (2, 2n) and the torque's share D(t) (2, m), in m/s^2.

        a = J y'' + (dp''/ds') y' + (dp''/ds) y,   y'' = M^-1 (B u - D_L y' - K_L y)

    An estimator subtracts D u, which is known, and uses C.
    """
    function = tip_slopes(lin)

    def parts(t: Array) -> tuple[Array, Array]:
        J, by_rate, by_y = symbolic.evaluate(function, *place_on_motion(lin, t))
        c = lin.sample(t)
        solved = solve_mass(c.M, np.concatenate([c.K, c.D, c.B], axis=2), t)
        n = lin.n
        return np.concatenate([by_y, by_rate], axis=2) - J @ solved[:, :, : 2 * n], J @ solved[:, :, 2 * n :]

    return lambda t: parts(t)[0], lambda t: parts(t)[1]


def encoder_rows(lin: Linearization) -> Array:
    """The encoders' readings of y, (m, n)."""
    return ca.DM(ca.densify(lin.arm.encoders[list(lin.driven), list(lin.kept)])).full()


def tip_slopes(lin: Linearization) -> ca.Function:
    """dp/ds, dp''/ds' and dp''/ds of the tip's position p along the rigid motion, each (2, n)."""
    arm, kept, E = lin.arm, list(lin.kept), lin.arm.reference
    if arm.points is None:
        raise ArgumentError(
            "the manipulator does not say where its tip is", got="points = None", expected="positions (2, k)"
        )
    tip = arm.points[:, -1]
    J = ca.jacobian(tip, arm.s)
    acceleration = J @ arm.s_ddot + ca.jtimes(J @ arm.s_dot, arm.s, arm.s_dot)
    parts = [J, ca.jacobian(acceleration, arm.s_dot), ca.jacobian(acceleration, arm.s)]
    angles = ca.SX.sym("angles", 3 * arm.joints)
    full = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    rigid = ca.densify(ca.vertcat(*[E @ part for part in ca.vertsplit(angles, arm.joints)]))
    values = ca.substitute([part[:, kept] for part in parts], [full], [rigid])
    return along_motion(arm, lin.motion, angles, {}, dict(zip(("J", "by_rate", "by_y"), values, strict=True)))
