"""The arm's equations as a log needs them: s'' and readings of state, inputs and free numbers, and their slopes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.control.sensors import READINGS
from flexlin.errors import ArgumentError
from flexlin.identification.log import Log
from flexlin.lazy import lazy
from flexlin.mechanics.chain import build_manipulator
from flexlin.mechanics.manipulator import Manipulator
from flexlin.program import Layout, Program
from flexlin.scene.scene import LogColumn, LogInput, LogOutput, LogTable, Scene

Compiled = Callable[..., list[Array]]


@dataclass(frozen=True, eq=False)
class Channel:
    """One column: its name in messages, and reading = (value - offset) / gain of an output, with the delay in s.

    place: the joint's input of a column of torques, -1 of a sensor; value: what a sensor sees of s, s' and s''; lowpass: angular
    frequency and damping ratio of the filter behind it.
    """

    name: str
    gain: ca.SX
    offset: ca.SX
    delay: ca.SX
    value: ca.SX
    place: int = -1
    lowpass: tuple[ca.SX, ca.SX] | None = None


def read_inputs(scene: Scene, arm: Manipulator, log: Log) -> list[Channel]:
    """The columns of torques, forces or voltages, each at its joint; joints without one get none.

    Raises: ArgumentError for a name that is no joint, or two of one joint of which neither says that it is meant.
    """
    table = logged(scene, arm).inputs
    columns = {name: table.get(name, LogInput(column=name)) for name in log.inputs}
    named = [find_joint(arm, name) for name, one in columns.items() if one.joint is None]
    if len(set(named)) < len(named):
        raise ArgumentError("two inputs of the log are of one joint", got=list(log.inputs), expected="one a joint")
    return [
        Channel(name, *calibration(one), ca.SX(0), find_joint(arm, one.joint or name)) for name, one in columns.items()
    ]


def read_outputs(scene: Scene, arm: Manipulator, log: Log) -> list[Channel]:
    """The sensors, as expressions of s, s' and s''; free numbers are symbols in them. Raises: ArgumentError for one that the arm lacks."""
    table = logged(scene, arm).outputs
    found = []
    for name in log.outputs:
        sensor = table.get(name, LogOutput(column=name))
        label = log.columns.get(name, name)
        low = sensor.lowpass
        passed = None if low is None else (2 * np.pi * ca.SX(low.frequency), ca.SX(low.damping))
        found.append(Channel(label, *calibration(sensor), see(scene, arm, name, sensor), lowpass=passed))
    return found


def logged(scene: Scene, arm: Manipulator) -> LogTable:
    """The scene's [log] with symbols for free numbers."""
    return arm.parameters.placed_in(scene).log or LogTable()


def calibration(column: LogColumn) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Gain, offset and delay."""
    return ca.SX(column.gain), ca.SX(column.offset), ca.SX(column.delay)


def find_joint(arm: Manipulator, name: str) -> int:
    """The number of a joint by its coordinate (q1) or by the name that the scene gives it."""
    joints = [c for c in arm.coordinates if c.kind == "joint"]
    for k, joint in enumerate(joints):
        if name and name in (joint.name, joint.joint):
            return k
    known = ", ".join(joint.name for joint in joints)
    raise ArgumentError(f"the arm has no joint {name!r}", got=name, expected=f"{known}, or a joint's name in the scene")


def see(scene: Scene, arm: Manipulator, name: str, sensor: LogOutput) -> ca.SX:
    """What a sensor reads, in the scene's units."""
    kind, axis = name_kind(arm, name) if sensor.sensor is None else (sensor.sensor, sensor.axis)
    if kind in ("coordinate", "rate"):
        own = name.removesuffix("_rate")
        if own not in arm.names:
            raise ArgumentError(f"there is no coordinate {own!r}", got=name, expected=", ".join(arm.names))
        return (arm.s if kind == "coordinate" else arm.s_dot)[arm.names.index(own)]
    if kind == "encoder":
        return READINGS[kind](arm)[find_joint(arm, name) if sensor.link is None else sensor.link]
    reading = READINGS[kind](arm, scene, sensor.link, sensor.at)
    row = "xyz".index(axis) if kind.startswith("tip") else 0
    if row >= reading.numel():
        raise ArgumentError(f"the arm has no tip.{axis}", got=name, expected="tip.x or tip.y of an arm in its plane")
    return reading[row]


def name_kind(arm: Manipulator, name: str) -> tuple[str, str]:
    """What an output is by its name, and its axis."""
    if name in arm.names:
        return "coordinate", ""
    if name.removesuffix("_rate") in arm.names:
        return "rate", ""
    for kind, word in (("tip", "tip."), ("tip-acceleration", "tip_acceleration.")):
        if name in [word + axis for axis in "xyz"]:
            return kind, name[-1]
    return "encoder", ""


def compiled(inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> Compiled:
    """Several expressions of the same columns, carried out at many points at once: inputs (N, rows), outputs (N, rows, columns)."""
    function = ca.Function("f", list(inputs), [ca.densify(one) for one in outputs])
    return lambda *given: symbolic.call(function, [np.ascontiguousarray(one) for one in given])


@dataclass(frozen=True, eq=False)
class Logged:
    """An arm with its log's columns: x' = f(x, u, p), reading = h(x, u, p), with x = [s; s'] and p the free numbers.

    A delay d in p shifts an input by its slope, u - (d - d0) u', and a reading by its own; d0 is taken into account by the windows.
    """

    arm: Manipulator
    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]

    @classmethod
    def of(cls, scene: Scene, log: Log, free: Sequence[str] = ()) -> "Logged":
        """Build the equations of a scene for the columns of a log.

        Raises: ArgumentError where a column fits no joint or sensor, or the arm has closed loops or prescribed joints.
        """
        arm = build_manipulator(scene, free)
        if arm.loops is not None:
            raise ArgumentError(
                "arms with closed loops cannot follow a log yet", got="loops", todo="write the open chain"
            )
        return cls(arm, tuple(read_inputs(scene, arm, log)), tuple(read_outputs(scene, arm, log)))

    @property
    def n(self) -> int:
        """Coordinates of the arm, and one of each filter behind a sensor."""
        return self.arm.n + len(self.filtered)

    @property
    def filtered(self) -> list[int]:
        """The outputs behind a filter."""
        return [j for j, one in enumerate(self.outputs) if one.lowpass is not None]

    @lazy
    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Columns of the inputs, their slopes in time, and the delays that the windows know of, as symbols."""
        return tuple(ca.SX.sym(name, len(self.inputs)) for name in ("u", "du", "known"))

    @lazy
    def motion(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Coordinates of arm and filters, their rates and accelerations, each (n, 1)."""
        own = (self.arm.s, self.arm.s_dot, self.arm.s_ddot)
        behind = [ca.SX.sym(name, len(self.filtered)) for name in ("z", "z_dot", "z_ddot")]
        return tuple(ca.vertcat(*pair) for pair in zip(own, behind, strict=True))

    @lazy
    def left(self) -> ca.SX:
        """M s'' + C s' + g + d - B torque of the arm; z'' + 2 zeta w z' + w^2 (z - y) of each filter; (n, 1)."""
        u, du, known = self.symbols
        force = ca.SX.zeros(self.arm.B.size2())
        for k, column in enumerate(self.inputs):
            force[column.place] += column.gain * (u[k] - (column.delay - known[k]) * du[k]) + column.offset
        z, rate, acceleration = (one[self.arm.n :] for one in self.motion)
        filters = [(self.outputs[j].value, self.outputs[j].lowpass) for j in self.filtered]
        behind = [
            acceleration[k] + 2 * low[1] * low[0] * rate[k] + low[0] ** 2 * (z[k] - value)
            for k, (value, low) in enumerate(filters)
            if low is not None
        ]
        return ca.vertcat(self.arm.residual - self.arm.B @ force, *behind)

    @property
    def given(self) -> list[ca.SX]:
        return [*self.motion[:2], *self.symbols, self.arm.parameters.symbols]

    @lazy
    def acceleration(self) -> ca.SX:
        """s'' and z'' of state, inputs and free numbers."""
        accelerations, own = self.motion[2], self.arm.n
        bare = ca.substitute(self.left, accelerations, ca.SX.zeros(self.n))
        arm = ca.ldl_solve(-bare[:own], *self.factors)
        if not self.filtered:
            return arm
        seen = ca.substitute(self.left[own:], accelerations, ca.vertcat(arm, ca.SX.zeros(self.n - own)))
        return ca.vertcat(arm, -seen)

    @lazy
    def factors(self) -> tuple[ca.SX, ca.SX, Any]:
        """M = L D L' of the arm: D, L and the order of its rows."""
        return ca.ldl(self.arm.M, False)

    @lazy
    def acceleration_slopes(self) -> ca.SX:
        """Slopes of s'' and z'' by coordinates, rates and p, (n, 2n + n_p): M ds'' = -d(left) with s'' held."""
        (at, rate, acceleration), own = self.motion, self.arm.n
        by = ca.jacobian(self.left, ca.vertcat(at, rate, self.arm.parameters.symbols))
        arm = ca.ldl_solve(-by[:own, :], *self.factors)
        behind = -by[own:, :] - ca.jacobian(self.left[own:], acceleration[:own]) @ arm
        return ca.substitute(ca.vertcat(arm, behind), acceleration, self.acceleration)

    @lazy
    def slopes(self) -> Compiled:
        """s'' and z'', (n, 1), and their slopes."""
        return compiled(self.given, [self.acceleration, self.acceleration_slopes])

    @lazy
    def stages(self) -> tuple[list[ca.SX], ca.SX, ca.SX]:
        """Columns x, u and u' at t, t + h/2, t + h, known delays, p and h; x(t + h), and its slopes by x and p, (2n, 2n + n_p).

        k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3), x + h/6 (k1 + 2 k2 + 2 k3 + k4); slopes by the chain rule.
        """
        n, m, p = self.n, len(self.inputs), self.arm.parameters.symbols
        f = ca.Function("f", self.given, [ca.vertcat(self.motion[1], self.acceleration), self.acceleration_slopes])
        x, h, known = ca.SX.sym("x", 2 * n), ca.SX.sym("h"), self.symbols[2]
        u, du = ca.SX.sym("u", m, 3), ca.SX.sym("du", m, 3)
        own = ca.horzcat(ca.SX.eye(2 * n), ca.SX(2 * n, p.numel()))
        held = ca.horzcat(ca.SX(p.numel(), 2 * n), ca.SX.eye(p.numel()))
        made, slopes, rate, faster = x, own, ca.SX(2 * n, 1), ca.SX(*own.shape)
        for c, phase, weight in ((0.0, 0, 1.0), (0.5, 1, 2.0), (0.5, 1, 2.0), (1.0, 2, 1.0)):
            at, moved = x + c * h * rate, own + c * h * faster
            rate, by = f(at[:n], at[n:], u[:, phase], du[:, phase], known, p)
            faster = ca.vertcat(moved[n:, :], by @ ca.vertcat(moved, held))
            made, slopes = made + weight * h / 6 * rate, slopes + weight * h / 6 * faster
        return [x, ca.vec(u), ca.vec(du), known, p, h], made, slopes

    @lazy
    def step(self) -> Layout:
        """x(t + h) of x(t) by the classical Runge-Kutta method."""
        columns, made, _ = self.stages
        return Program.read(ca.Function("step", columns, [ca.densify(made)])).lay_out()

    @lazy
    def step_slopes(self) -> Compiled:
        """The exact slopes of such a step."""
        columns, _, slopes = self.stages
        return compiled(columns, [slopes])

    @lazy
    def readings(self) -> ca.SX:
        z = {j: self.motion[0][self.arm.n + k] for k, j in enumerate(self.filtered)}
        return ca.vertcat(*[(z.get(j, one.value) - one.offset) / one.gain for j, one in enumerate(self.outputs)])

    @lazy
    def delays(self) -> Compiled:
        """Of inputs (m, 1) and outputs (k, 1) at p, in s, and the slopes of the latter by p."""
        inputs, outputs = (ca.vertcat(*[one.delay for one in group]) for group in (self.inputs, self.outputs))
        p = self.arm.parameters.symbols
        return compiled([p], [inputs, outputs, ca.jacobian(outputs, p)])

    @lazy
    def accelerated(self) -> bool:
        """Whether a sensor without a filter sees accelerations."""
        return bool(ca.depends_on(self.readings, self.arm.s_ddot))

    @lazy
    def read(self) -> Compiled:
        return compiled([*self.given, self.motion[2]], [self.readings])

    @lazy
    def reading_slopes(self) -> Compiled:
        """Slopes of the readings by state and p, (k, 2n + n_p), and by accelerations."""
        at, rate, acceleration = self.motion
        by = [ca.vertcat(at, rate, self.arm.parameters.symbols), acceleration]
        return compiled([*self.given, acceleration], [ca.jacobian(self.readings, one) for one in by])
