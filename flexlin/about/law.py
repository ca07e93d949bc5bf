"""What commands the torque, answered once: torque = forward(t) - gain(t) [[y; y'] - reference(t); z]."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import itemgetter

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.about.compensator import Compensator, write_compensator
from flexlin.about.deviation import Deviation
from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.coefficients import Combined, Constant, MatrixFunction
from flexlin.scene.control import Control
from flexlin.summary import represent

VectorFunction = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Controller:
    """What a law remembers, z: integrals of errors and states of filters.

        z' = rates [[y; y'] - reference; z] + unwinding (asked - given)

    rates: (k, 2n + k); unwinding: (k, m), what a torque that is not given takes from the integrals; names, units: of the k states.
    """

    rates: Array
    unwinding: Array
    names: tuple[str, ...]
    units: tuple[str, ...]

    __repr__ = represent

    @property
    def states(self) -> int:
        """The number k of states."""
        return len(self.rates)


@dataclass(frozen=True, eq=False)
class Law:
    """A control law: torque = forward(t) - gain(t) [[y; y'] - reference(t); z], in N m (N for sliding joints, V for motors).

    feedforward: its kind, "none", "rigid" (the torque of the rigid motion), or that of a computed one such as "tip-exact";
    forward, gain, reference: times (N,) -> (N, m), (N, m, 2n + k), (N, 2n); controller: what has the states z, if anything has (k = 0).
    """

    feedforward: str
    forward: VectorFunction
    gain: MatrixFunction
    reference: VectorFunction
    controller: Controller | None = None

    __repr__ = represent

    @classmethod
    def constant(cls, gain: ArrayLike, forward: ArrayLike | None = None) -> "Law":
        """A constant gain (m, 2n), and if given a constant torque (m,)."""
        K = real_array("gain", gain, (None, None))
        torque = np.zeros(len(K)) if forward is None else real_array("forward", forward, (len(K),))
        kind = "none" if forward is None else "constant"
        return cls(kind, Constant(torque), Constant(K), Constant(np.zeros(K.shape[1])))

    @property
    def memory(self) -> int:
        """The number k of the controller's own states."""
        return 0 if self.controller is None else self.controller.states

    @property
    def direct(self) -> "Law":
        """The part that answers [y; y'] at once, without the controller's states."""
        if self.controller is None:
            return self
        arm = Combined(itemgetter((slice(None), slice(None), slice(-self.memory))), (self.gain,))
        return replace(self, gain=arm, controller=None)

    def with_gain(self, gain: MatrixFunction | ArrayLike, controller: Controller | None = None) -> "Law":
        """The same feedforward and reference with another gain, a function (N,) -> (N, m, 2n + k) or a constant, and its controller.

        Raises: ArgumentError when the gain's shape is not that of the arm's states and the controller's.
        """
        chosen = gain if callable(gain) else Constant(real_array("gain", gain, (None, None)))
        now = np.zeros(1)
        states = self.reference(now).shape[1] + (0 if controller is None else controller.states)
        got, expected = np.shape(chosen(now))[1:], (np.shape(self.gain(now))[1], states)
        if got != expected:
            raise ArgumentError("the gain does not fit the arm", got=got, expected=str(expected))
        return replace(self, gain=chosen, controller=controller)

    def offset(self, t: Array) -> Array:
        """What the law commands at x = 0: forward + gain [reference; 0], (N, m)."""
        reference = self.reference(t)
        return self.forward(t) + np.einsum("tij,tj->ti", self.gain(t)[:, :, : reference.shape[1]], reference)

    def torque(self, t: Array, x: Array) -> Array:
        """The commanded torque (N, m) for states x = [y; y'; z] (N, 2n + k)."""
        return self.forward(t) - np.einsum("tij,tj->ti", self.gain(t), self.deviation(t, x))

    def deviation(self, t: Array, x: Array) -> Array:
        """[[y; y'] - reference; z] for states x = [y; y'; z] (N, 2n + k)."""
        reference = self.reference(t)
        return np.concatenate([x[:, : reference.shape[1]] - reference, x[:, reference.shape[1] :]], axis=1)

    def steer(self, reference: Array) -> Array:
        """What references (N, 2n) put into z', -rates [reference; 0], (N, k)."""
        if self.controller is None:
            return np.zeros((len(reference), 0))
        return np.asarray(-reference @ self.controller.rates[:, : reference.shape[1]].T)


def is_constant(samples: Array) -> bool:
    """Whether samples (N, ...) are one value that was broadcast."""
    return samples.strides[0] == 0


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
