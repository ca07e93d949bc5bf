"""Linearization about a periodic motion of the elastic arm, in the place of the rigid one."""

import casadi as ca

from flexlin import symbolic
from flexlin.about.linear import Linearization, along_motion
from flexlin.about.periodic_motion import PeriodicMotion, constant, own_gain, place_on_motion
from flexlin.checks import Array
from flexlin.periodic.system import PeriodicSystem


def linearize_about(motion: PeriodicMotion, closed: bool = True) -> PeriodicSystem:
    """Linearize the equations about a periodic motion of the elastic arm itself.

        M z'' + D z' + K z = B u,   M = d r/d s'',  D = d r/d s',  K = d r/d s,   r = M(s) s'' + C s' + g + d - B(s) torque

    at s = s_R + y of the motion. The motion solves the equations, so nothing is left over on the right side (h = 0), and where
    the links are bent D is not zero even for a single link.

    Parameters: motion: from `periodic_motion` or a feedforward's; closed: with the scene's feedback, else the arm alone.
    Returns: the periodic system of z, with input u the torque beside it.
    Raises: SingularMassMatrix.
    Source: Khang, Dat, Tuan (2019), section 4, with the elastic motion as basic motion.
    """
    lin, function = motion.lin, slopes(motion.lin)

    def evaluate(t: Array) -> tuple[Array, ...]:
        state, rates = (motion.y(t), motion.y(t, 1), motion.y(t, 2)), motion.torque(t)
        return symbolic.evaluate(function, *state, rates, *place_on_motion(lin, t))

    def together(t: Array) -> tuple[Array, Array, Array]:
        M, D, K, _ = evaluate(t)
        return M, D, K

    M, D, K, B = ((lambda t, i=i: evaluate(t)[i]) for i in range(4))
    system = PeriodicSystem.from_second_order(M, D, K, lin.period, B, lin.breaks, together)
    return system.feedback(constant(own_gain(lin))) if closed else system


def slopes(lin: Linearization) -> ca.Function:
    """M, D, K, B about s = s_R + y, as functions of y, y', y'', torque and the place on the motion."""
    arm, kept, driven, E = lin.arm, list(lin.kept), list(lin.driven), lin.arm.reference
    extra = [ca.SX.sym(name, lin.n) for name in ("y", "y1", "y2")]
    torque, angles = ca.SX.sym("torque", len(driven)), ca.SX.sym("angles", 3 * arm.joints)
    select = ca.DM.eye(arm.n)[:, kept]
    moved = [E @ part + select @ add for part, add in zip(ca.vertsplit(angles, arm.joints), extra, strict=True)]
    inputs = arm.B[:, driven]
    left = arm.residual - inputs @ torque
    parts = [ca.jacobian(left, by)[kept, kept] for by in (arm.s_ddot, arm.s_dot, arm.s)]
    full = ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)
    M, D, K, B = ca.substitute([*parts, inputs[kept, :]], [full], [ca.densify(ca.vertcat(*moved))])
    named = dict(zip(("y", "y1", "y2", "torque"), [*extra, torque], strict=True))
    return along_motion(arm, lin.motion, angles, named, {"M": M, "D": D, "K": K, "B": B})
