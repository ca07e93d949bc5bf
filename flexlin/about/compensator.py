"""The scene's feedback as a linear compensator of the measured joints: PD or PID, with filters before and behind its gains."""

from dataclasses import dataclass, field
from math import pi, sqrt
from typing import Any

import casadi as ca

from flexlin.about.deviation import Deviation
from flexlin.errors import ArgumentError
from flexlin.mechanics.effects import effects_of
from flexlin.scene.control import AnyFilter, Control, LowPass, Pid

INTEGRAL = "_integral"
"""What stands behind a coordinate's name for the integral of its error."""


@dataclass(frozen=True, eq=False)
class Compensator:
    """The feedback u = -gain [s; s'; z], z' = rates [s; s'; z] + unwinding (asked - given), in all coordinates of the arm.

    gain (m, 2 arm.n + k), rates (k, 2 arm.n + k), unwinding (k, m): expressions of the free parameters; names, units: of the k states.
    """

    gain: ca.SX
    rates: ca.SX
    unwinding: ca.SX
    names: tuple[str, ...]
    units: tuple[str, ...]


@dataclass
class Memory:
    """The states of a compensator while it is put together: symbols, their rates, and what each takes up of a torque that is not given."""

    symbols: list[ca.SX] = field(default_factory=list)
    rates: list[ca.SX] = field(default_factory=list)
    unwinding: list[ca.SX] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)

    def integrate(self, names: list[str], unit: str) -> list[ca.SX]:
        """New states by their names; their rates are to follow."""
        found = [ca.SX.sym(name) for name in names]
        self.symbols += found
        self.names += names
        self.units += [unit] * len(names)
        return found

    def follow(self, rate: ca.SX, unwinding: ca.SX) -> None:
        """The rate of the next state, and its row of `unwinding`."""
        self.rates.append(rate)
        self.unwinding.append(unwinding)


def write_compensator(about: Deviation, control: Control) -> Compensator:
    """Write the scene's feedback: filters of the rates, the gains, filters of the torque.

        u = -F_torque (kp e + kd F_rates e' + ki int e dt),   e = encoders (s - s_R)

    Raises: ArgumentError when there is not one gain for each torque-driven joint.
    """
    arm, placed, memory = about.arm, about.arm.parameters.placed_in(control, "control."), Memory()
    check_gains(placed, about.m)
    s, rate = ca.SX.sym("s", arm.n), ca.SX.sym("s1", arm.n)
    torque = [
        torque_of(placed, memory, row, arm.encoders[joint, :] @ s, arm.encoders[joint, :] @ rate, about)
        for row, joint in enumerate(about.driven if placed.feedback is not None else ())
    ]
    x = ca.vertcat(s, rate, *memory.symbols)
    gain = ca.jacobian(ca.vertcat(*torque), x) if torque else ca.SX(about.m, 2 * arm.n)
    rates = ca.jacobian(ca.vertcat(*memory.rates), x) if memory.names else ca.SX(0, 2 * arm.n)
    unwinding = ca.vertcat(*memory.unwinding) if memory.names else ca.SX(0, about.m)
    return Compensator(gain, rates, unwinding, tuple(memory.names), tuple(memory.units))


def check_gains(control: Control, joints: int) -> None:
    """Refuse gains and filters that do not fit the torque-driven joints."""
    feedback = control.feedback
    for name in ("kp", "kd", "ki") if feedback is not None else ():
        gains = getattr(feedback, name, None)
        if gains is not None and len(gains) != joints:
            raise ArgumentError(
                f"{name} does not fit the arm", got=f"{len(gains)} gains", expected=f"{joints} torque-driven joints"
            )
    for i, one in enumerate(control.filters):
        if max(one.joints or (1,)) > joints:
            expected = f"numbers from 1 to {joints}"
            raise ArgumentError(f"control.filters.{i}.joints does not fit the arm", got=one.joints, expected=expected)


def torque_of(control: Control, memory: Memory, row: int, angle: ca.SX, rate: ca.SX, about: Deviation) -> ca.SX:
    """What one joint's feedback subtracts from the torque."""
    feedback, moved, none = (
        control.feedback,
        about.arm.coordinates[about.arm.drives[about.driven[row]]],
        ca.SX(1, about.m),
    )
    assert feedback is not None
    for i, one in chosen(control, "rates", row):
        rate = pass_through(one, memory, rate, (f"{moved.name}_filter{i + 1}", f"{moved.unit}/s"), none)
    torque = feedback.kp[row] * angle + feedback.kd[row] * rate
    if isinstance(feedback, Pid) and (isinstance(feedback.ki[row], ca.SX) or feedback.ki[row] != 0):
        (integral,) = memory.integrate([moved.name + INTEGRAL], f"{moved.unit} s")
        taken = ca.SX(1, about.m)
        if feedback.tracking_time is not None:
            taken[row] = 1 / (feedback.ki[row] * feedback.tracking_time)
        memory.follow(angle, taken)
        torque += feedback.ki[row] * integral
    for i, one in chosen(control, "torque", row):
        unit = made_by_motors(about) or ("N" if moved.unit == "m" else "N m")
        torque = pass_through(one, memory, torque, (f"{moved.name}_filter{i + 1}", unit), none)
    return torque


def made_by_motors(about: Deviation) -> str | None:
    """The unit of the inputs, where an effect of the arm makes it another than that of its joints' torques."""
    tables = about.arm.effects
    units = [effect.input_unit for effect in effects_of(tables)] if tables is not None else []
    return next((unit for unit in reversed(units) if unit is not None), None)


def chosen(control: Control, on: str, row: int) -> list[tuple[int, AnyFilter]]:
    """The filters of one joint's torque or rate, with their places in the scene."""
    found = enumerate(control.filters)
    return [(i, one) for i, one in found if one.on == on and (one.joints is None or row + 1 in one.joints)]


def pass_through(one: AnyFilter, memory: Memory, signal: ca.SX, named: tuple[str, str], none: ca.SX) -> ca.SX:
    """The signal behind a filter; its states have the unit of the signal; named: what they are called, and that unit.

    low-pass: z' = w (u - z), of order 2 z1' = w z2, z2' = w (u - z1 - sqrt(2) z2);   notch: z1' = w z2, z2' = w (u - z1 - 2 zeta z2),
    output u - 2 zeta (1 - gain) z2
    """
    name, unit = named
    w: Any = 2 * pi * (one.cutoff if isinstance(one, LowPass) else one.frequency)
    if isinstance(one, LowPass) and one.order == 1:
        (z,) = memory.integrate([name], unit)
        memory.follow(w * (signal - z), none)
        return z
    damping: Any = sqrt(0.5) if isinstance(one, LowPass) else one.damping
    first, second = memory.integrate([f"{name}_1", f"{name}_2"], unit)
    memory.follow(w * second, none)
    memory.follow(w * (signal - first - 2 * damping * second), none)
    return first if isinstance(one, LowPass) else signal - 2 * damping * (1 - one.gain) * second
