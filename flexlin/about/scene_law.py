"""The law that a scene's control table describes."""

import casadi as ca
import numpy as np

from flexlin.about.compensator import Compensator, write_compensator
from flexlin.about.deviation import Deviation
from flexlin.about.law import Controller, Law, VectorFunction
from flexlin.checks import Array
from flexlin.periodic.coefficients import Constant
from flexlin.scene.control import Control


def feedback_expressions(about: Deviation, control: Control) -> tuple[ca.SX, ca.SX]:
    """What of the scene's feedback answers at once, u = -K_p s - K_d s', as matrices (m, arm.n), expressions of the free parameters.

    Raises: ArgumentError when there is not one gain for each torque-driven joint.
    """
    n, gain = about.arm.n, write_compensator(about, control).gain
    return gain[:, :n], gain[:, n : 2 * n]


def scene_law(about: Deviation, control: Control | None, rigid: VectorFunction) -> Law:
    """The scene's law in numbers, at the parameters' own values; without a control table no torque at all.

    The linear equations are those about the rigid motion: for "joint-exact" and "tip-exact" too the torque of the rigid motion is fed
    forward here, and `control.feedforward` computes what is to be added.

    Parameters: rigid: the torque of the rigid motion, (N,) -> (N, m).
    """
    rest, none = Constant(np.zeros(2 * about.n)), Constant(np.zeros(about.m))
    if control is None:
        return Law("none", none, Constant(np.zeros((about.m, 2 * about.n))), rest)
    gain, controller = in_numbers(about, write_compensator(about, control))
    kind, forward = ("none", none) if control.feedforward == "none" else ("rigid", rigid)
    return Law(kind, forward, Constant(gain), rest, controller)


def in_numbers(about: Deviation, found: Compensator) -> tuple[Array, Controller | None]:
    """The gain (m, 2n + k) and the controller, in the coordinates kept and at the parameters' own values."""
    parameters = about.arm.parameters
    parts = [*kept_columns(about, found), found.unwinding]
    values = ca.Function("feedback", [parameters.symbols], [ca.densify(part) for part in parts])(parameters.values)
    gain, rates, unwinding = (value.full() for value in values)
    return gain, Controller(rates, unwinding, found.names, found.units) if found.names else None


def kept_columns(about: Deviation, found: Compensator) -> tuple[ca.SX, ca.SX]:
    """A compensator's gain (m, 2n + k) and rates (k, 2n + k) in the coordinates kept."""
    arm, kept = about.arm.n, list(about.kept)
    columns = [*kept, *(arm + i for i in kept), *range(2 * arm, found.gain.size2())]
    return found.gain[:, columns], found.rates[:, columns]
