"""The law that a scene's control table describes."""

import casadi as ca
import numpy as np

from flexlin.about.deviation import Deviation
from flexlin.about.law import Law, VectorFunction
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Constant
from flexlin.scene.control import Control


def feedback_expressions(about: Deviation, control: Control) -> tuple[ca.SX, ca.SX]:
    """The scene's feedback u = -K_p s - K_d s' as matrices (m, arm.n) over all coordinates, expressions of the free parameters.

        K_p = kp encoders,   K_d = kd encoders,   one row for each torque-driven joint

    Raises: ArgumentError when there is not one gain for each torque-driven joint.
    """
    arm, driven = about.arm, about.driven
    kp, kd = ca.SX(about.m, arm.n), ca.SX(about.m, arm.n)
    feedback = arm.parameters.placed_in(control, "control.").feedback
    if feedback is None:
        return kp, kd
    for name, matrix, gains in (("kp", kp, feedback.kp), ("kd", kd, feedback.kd)):
        if len(gains) != about.m:
            raise ArgumentError(
                f"{name} does not fit the arm", got=f"{len(gains)} gains", expected=f"{about.m} torque-driven joints"
            )
        for row, joint in enumerate(driven):
            matrix[row, :] = gains[row] * arm.encoders[joint, :]
    return kp, kd


def scene_law(about: Deviation, control: Control | None, rigid: VectorFunction) -> Law:
    """The scene's law in numbers, at the parameters' own values; without a control table no torque at all.

    The linear equations are those about the rigid motion: for "joint-exact" and "tip-exact" too the torque of the rigid motion is fed
    forward here, and `control.feedforward` computes what is to be added.

    Parameters: rigid: the torque of the rigid motion, (N,) -> (N, m).
    """
    rest, none = Constant(np.zeros(2 * about.n)), Constant(np.zeros(about.m))
    if control is None:
        return Law("none", none, Constant(np.zeros((about.m, 2 * about.n))), rest)
    kept, parameters = list(about.kept), about.arm.parameters
    kp, kd = feedback_expressions(about, control)
    gain = ca.Function("gain", [parameters.symbols], [ca.densify(ca.horzcat(kp[:, kept], kd[:, kept]))])
    kind, forward = ("none", none) if control.feedforward == "none" else ("rigid", rigid)
    return Law(kind, forward, Constant(gain(parameters.values).full()), rest)
