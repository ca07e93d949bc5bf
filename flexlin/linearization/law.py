"""What commands the torque, answered once: torque = forward(t) - gain(t) [[y; y'] - reference(t); z].

A scene's feedback is a linear compensator of the measured joints: PD or PID, with filters before and behind its gains.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import pi, sqrt
from operator import itemgetter
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError, counted
from flexlin.linearization.deviation import Deviation
from flexlin.periodic.coefficients import Combined, Constant, MatrixFunction
from flexlin.scene.control import AnyFilter, Control, LowPass, Pid
from flexlin.summary import immutable

INTEGRAL = "_integral"
"""What stands behind a coordinate's name for the integral of its error."""


VectorFunction = Callable[[Array], Array]


@immutable(eq=False)
class Controller:
    """What a law remembers, z: integrals of errors and states of filters.

        z' = rates [[y; y'] - reference; z] + unwinding (asked - given)

    rates: (k, 2n + k); unwinding: (k, m), what a torque that is not given takes from the integrals; names, units: of the k states.
    """

    rates: Array
    unwinding: Array
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def states(self) -> int:
        """The number k of states."""
        return len(self.rates)


@immutable(eq=False)
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

    @classmethod
    def constant(cls, gain: ArrayLike) -> "Law":
        """A constant gain (m, 2n) alone."""
        K = real_array("gain", gain, (None, None))
        return cls("none", Constant(np.zeros(len(K))), Constant(K), Constant(np.zeros(K.shape[1])))

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

    def offset(self, t: Array, forward: Array | None = None) -> Array:
        """What the law commands at x = 0: forward + gain [reference; 0], (N, m); `forward` where it is known."""
        reference, forward = self.reference(t), self.forward(t) if forward is None else forward
        return forward + np.einsum("tij,tj->ti", self.gain(t)[:, :, : reference.shape[1]], reference)

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


@dataclass
class Memory:
    """The k states of a compensator while it is put together: what they are, their rates, and what each takes of m torques not given."""

    m: int
    states: list[ca.SX] = field(default_factory=list)
    rates: list[ca.SX] = field(default_factory=list)
    unwinding: list[ca.SX] = field(default_factory=list)
    units: list[str] = field(default_factory=list)

    def begin(self, name: str, unit: str) -> ca.SX:
        """A new state; its rate is to follow."""
        self.states.append(ca.SX.sym(name))
        self.units.append(unit)
        return self.states[-1]

    def follow(self, rate: ca.SX, unwinding: ca.SX | None = None) -> None:
        """The rate of the next state, and its row of `unwinding`."""
        self.rates.append(rate)
        self.unwinding.append(ca.SX(1, self.m) if unwinding is None else unwinding)


def check_gains(control: Control, joints: int) -> None:
    """Refuse gains and filters that do not fit the torque-driven joints."""
    feedback = control.feedback
    for name in ("kp", "kd", "ki") if feedback is not None else ():
        gains = getattr(feedback, name, None)
        if gains is not None and len(gains) != joints:
            raise ArgumentError(
                f"{name} does not fit the arm",
                got=counted(len(gains), "gain"),
                expected=f"{joints} torque-driven joints",
            )
    for i, one in enumerate(control.filters):
        if max(one.joints or (1,)) > joints:
            expected = f"numbers from 1 to {joints}"
            raise ArgumentError(f"control.filters.{i}.joints does not fit the arm", got=one.joints, expected=expected)


def torque_of(control: Control, memory: Memory, row: int, angle: ca.SX, rate: ca.SX, about: Deviation) -> ca.SX:
    """What one joint's feedback subtracts from the torque."""
    feedback, moved = control.feedback, about.arm.coordinates[about.arm.drives[about.driven[row]]]
    assert feedback is not None
    for i, one in chosen(control, "rates", row):
        rate = pass_through(one, memory, rate, f"{moved.name}_filter{i + 1}", f"{moved.unit}/s")
    torque = feedback.kp[row] * angle + feedback.kd[row] * rate
    if isinstance(feedback, Pid) and (isinstance(feedback.ki[row], ca.SX) or feedback.ki[row] != 0):
        integral, taken = memory.begin(moved.name + INTEGRAL, f"{moved.unit} s"), ca.SX(1, about.m)
        if feedback.tracking_time is not None:
            taken[row] = 1 / (feedback.ki[row] * feedback.tracking_time)
        memory.follow(angle, taken)
        torque += feedback.ki[row] * integral
    for i, one in chosen(control, "torque", row):
        torque = pass_through(one, memory, torque, f"{moved.name}_filter{i + 1}", about.input_units[row])
    return torque


def chosen(control: Control, on: str, row: int) -> list[tuple[int, AnyFilter]]:
    """The filters of one joint's torque or rate, with their places in the scene."""
    found = enumerate(control.filters)
    return [(i, one) for i, one in found if one.on == on and (one.joints is None or row + 1 in one.joints)]


def pass_through(one: AnyFilter, memory: Memory, signal: ca.SX, name: str, unit: str) -> ca.SX:
    """The signal behind a filter, whose states bear its name and the unit of the signal.

    low-pass: z' = w (u - z), of order 2 z1' = w z2, z2' = w (u - z1 - sqrt(2) z2);   notch: z1' = w z2, z2' = w (u - z1 - 2 zeta z2),
    output u - 2 zeta (1 - gain) z2
    """
    w: Any = 2 * pi * (one.cutoff if isinstance(one, LowPass) else one.frequency)
    if isinstance(one, LowPass) and one.order == 1:
        z = memory.begin(name, unit)
        memory.follow(w * (signal - z))
        return z
    damping: Any = sqrt(0.5) if isinstance(one, LowPass) else one.damping
    first, second = memory.begin(f"{name}_1", unit), memory.begin(f"{name}_2", unit)
    memory.follow(w * second)
    memory.follow(w * (signal - first - 2 * damping * second))
    return first if isinstance(one, LowPass) else signal - 2 * damping * (1 - one.gain) * second


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
        """Write it once: filters of the rates, the gains, filters of the torque.

            u = -F_torque (kp e + kd F_rates e' + ki int e dt),   e = encoders y

        Raises: ArgumentError when there is not one gain for each torque-driven joint.
        """
        arm, memory = about.arm, Memory(about.m)
        placed = arm.parameters.placed_in(control, "control.")
        check_gains(placed, about.m)
        y, rate = ca.SX.sym("y", about.n), ca.SX.sym("y1", about.n)
        encoders, torque = arm.encoders[list(about.driven), list(about.kept)], ca.SX(about.m, 1)
        for row in range(about.m if placed.feedback is not None else 0):
            torque[row] = torque_of(placed, memory, row, encoders[row, :] @ y, encoders[row, :] @ rate, about)
        x = ca.vertcat(y, rate, *memory.states)
        gain, rates = ca.jacobian(torque, x), ca.jacobian(ca.vertcat(ca.SX(0, 1), *memory.rates), x)
        unwinding = ca.vertcat(ca.SX(0, about.m), *memory.unwinding)
        function = ca.Function("feedback", [arm.parameters.symbols], list(map(ca.densify, (gain, rates, unwinding))))
        return cls(function, tuple(one.name() for one in memory.states), tuple(memory.units))

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
