"""The law that a scene's control table describes."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.about.compensator import Compensator, write_compensator
from flexlin.about.deviation import Deviation
from flexlin.about.law import Controller, Law, VectorFunction
from flexlin.checks import Array
from flexlin.periodic.coefficients import Constant
from flexlin.scene.control import Control


@dataclass(frozen=True, eq=False)
class Feedback:
    """A scene's feedback in the coordinates kept, u = -gain [y; y'; z], as a function of the free parameters.

    `function`: p -> gain (m, 2n + k), rates (k, 2n + k), unwinding (k, m); names, units: of the controller's k states.
    """

    function: ca.Function
    names: tuple[str, ...]
    units: tuple[str, ...]

    @classmethod
    def of(cls, about: Deviation, control: Control) -> "Feedback":
        """Write it once. Raises: ArgumentError when there is not one gain for each torque-driven joint."""
        found = write_compensator(about, control)
        parts = [ca.densify(part) for part in (*kept_columns(about, found), found.unwinding)]
        return cls(ca.Function("feedback", [about.arm.parameters.symbols], parts), found.names, found.units)

    def close(self, plant: dict[str, ca.SX], p: ca.SX) -> dict[str, ca.SX]:
        """D + B gain_y' and K + B gain_y from D, K, B of the arm; p: the free parameters in them."""
        gain, n = self.function.call([p])[0], plant["D"].size1()
        return {"D": plant["D"] + plant["B"] @ gain[:, n : 2 * n], "K": plant["K"] + plant["B"] @ gain[:, :n]}

    def at(self, values: Array) -> tuple[Array, Controller | None]:
        """The gain and the controller at values (P,) of the free parameters."""
        gain, rates, unwinding = (value.full() for value in self.function(values))
        return gain, Controller(rates, unwinding, self.names, self.units) if self.names else None


def scene_law(about: Deviation, control: Control | None, rigid: VectorFunction, feedback: Feedback | None) -> Law:
    """The scene's law in numbers, at the parameters' own values; without a control table no torque at all.

    The linear equations are those about the rigid motion: for "joint-exact" and "tip-exact" too the torque of the rigid motion is fed
    forward here, and `control.feedforward` computes what is to be added.

    Parameters: rigid: the torque of the rigid motion, (N,) -> (N, m); feedback: the control's, none where it has none.
    """
    rest, none = Constant(np.zeros(2 * about.n)), Constant(np.zeros(about.m))
    gain, controller = (
        (np.zeros((about.m, 2 * about.n)), None) if feedback is None else feedback.at(about.arm.parameters.values)
    )
    feeds_forward = control is not None and control.feedforward != "none"
    kind, forward = ("rigid", rigid) if feeds_forward else ("none", none)
    return Law(kind, forward, Constant(gain), rest, controller)


def kept_columns(about: Deviation, found: Compensator) -> tuple[ca.SX, ca.SX]:
    """A compensator's gain (m, 2n + k) and rates (k, 2n + k) in the coordinates kept."""
    arm, kept = about.arm.n, list(about.kept)
    columns = [*kept, *(arm + i for i in kept), *range(2 * arm, found.gain.size2())]
    return found.gain[:, columns], found.rates[:, columns]
