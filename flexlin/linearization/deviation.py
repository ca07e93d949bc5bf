"""Where the arm is when it deviates from its rigid motion, s = E q(t) + P y: in expressions and numbers."""

from collections.abc import Iterable
from dataclasses import replace

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.errors import InputError
from flexlin.lazy import lazy
from flexlin.mechanics.effects import effects_of
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion, SymbolicMotion
from flexlin.summary import immutable


@immutable(eq=False)
class Deviation:
    """The small motion y of an arm about a rigid basic motion.

        s = E q(t) + P y,   s' = E q'(t) + P y',   s'' = E q''(t) + P y''

    E = `arm.reference` leads the coordinates along the motion; P picks the coordinates `kept`, which no prescribed joint fixes.
    `driven` are the joints that a torque drives.
    """

    arm: Manipulator
    motion: Motion
    kept: tuple[int, ...]
    driven: tuple[int, ...]

    @classmethod
    def of(cls, arm: Manipulator, motion: Motion) -> "Deviation":
        """The deviation in all coordinates that the motion does not prescribe. Raises: InputError when none is left."""
        fixed = {arm.drives[i] for i in range(arm.joints) if motion.prescribed[i]}
        kept = tuple(k for k in range(arm.n) if k not in fixed)
        if not kept:
            raise InputError(
                "nothing is left to move",
                got="every coordinate prescribed",
                expected="a link with modes or a driven joint",
            )
        return cls(arm, motion, kept, tuple(i for i in range(arm.joints) if not motion.prescribed[i]))

    @property
    def n(self) -> int:
        """The number of coordinates y."""
        return len(self.kept)

    @property
    def m(self) -> int:
        """The number of torques."""
        return len(self.driven)

    @property
    def input_units(self) -> tuple[str, ...]:
        """The units of the torques: what an effect makes of them, such as V behind a motor, else the force of each joint."""
        effects = () if self.arm.effects is None else effects_of(self.arm.effects)
        made = [effect.input_unit for effect in effects if effect.input_unit is not None]
        moved = [self.arm.coordinates[self.arm.drives[i]].unit for i in self.driven]
        return tuple(made[-1] if made else "N" if unit == "m" else "N m" for unit in moved)

    @lazy
    def near(self) -> "Deviation":
        """The same with equations that hold to first order about the rigid motion, which are shorter."""
        return self if self.arm.near is self.arm else replace(self, arm=self.arm.near)

    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """New symbols of one time, y, y', y'' (n, 1), and the rigid motion's [q; q'; q''] (3 joints, 1)."""
        y, rate, acceleration = (ca.SX.sym(name, self.n) for name in ("y", "y1", "y2"))
        return y, rate, acceleration, self.rigid_motion()

    def rigid_motion(self) -> ca.SX:
        """[q; q'; q''] as expressions of phase and the arm's parameters, or new symbols for a motion that is given by numbers."""
        motion = self.motion
        if not isinstance(motion, SymbolicMotion):
            return ca.SX.sym("angles", 3 * self.arm.joints)
        return ca.substitute(ca.vertcat(*motion.rates), motion.parameters.symbols, self.arm.parameters.symbols)

    def coordinates(self, angles: ca.SX, *deviation: ca.SX) -> list[ca.SX]:
        """s, s', s'' as expressions; `deviation` is y, y', y'', as many as are not zero."""
        parts = [self.arm.reference @ part for part in ca.vertsplit(angles, self.arm.joints)]
        pick = ca.DM.eye(self.arm.n)[:, list(self.kept)]
        for level, extra in enumerate(deviation):
            parts[level] = parts[level] + pick @ extra
        return [ca.densify(part) for part in parts]

    def lift(self, expressions: Iterable[ca.SX], angles: ca.SX, *deviation: ca.SX) -> list[ca.SX]:
        """Expressions of s, s', s'' as expressions of y, y', y'' (as many as are not zero) and of the angles.

        Where loops are closed, symbols of the joints that follow become what these joints do there.
        """
        arm = self.arm
        known, at = [ca.vertcat(arm.s, arm.s_dot, arm.s_ddot)], [ca.vertcat(*self.coordinates(angles, *deviation))]
        if arm.loops is not None:
            (followers,) = ca.substitute([arm.loops.followers], known, at)
            known, at = [*known, arm.loops.v], [*at, followers]
        if arm.phase is not None and isinstance(self.motion, SymbolicMotion):
            known, at = [*known, arm.phase], [*at, self.motion.phase]
        return list(ca.substitute(list(expressions), known, at))

    def function(self, angles: ca.SX, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]) -> ca.Function:
        """A function of `inputs`, the place on the motion, and the free parameters; evaluate it with `evaluate`.

        angles: those of `symbols`. The place is the phase, or q, q', q'' for a motion that is given by numbers.
        """
        motion, p, values = self.motion, self.arm.parameters.symbols, list(outputs.values())
        if isinstance(motion, SymbolicMotion):
            place = {"phase": motion.phase}
        else:
            place = dict(zip(("q", "q1", "q2"), ca.vertsplit(angles, self.arm.joints), strict=True))
            place |= {} if self.arm.phase is None else {"phase": self.arm.phase}
        named = {**inputs, **place, "p": p}
        dense = [ca.densify(value) for value in values]
        return ca.Function("about_motion", list(named.values()), dense, list(named), list(outputs))

    def place(self, t: Array) -> list[Array]:
        """The arguments that functions take after their own inputs at times (N,): the place on the motion, and the parameters."""
        motion, values = self.motion, self.arm.parameters.values
        by_phase = isinstance(motion, SymbolicMotion)
        angles = [] if by_phase else [np.ascontiguousarray(part, float) for part in motion.sample(t)]
        phase = [motion.phase_of(t)[:, None]] if by_phase or self.arm.phase is not None else []
        return [*angles, *phase, np.full((len(t), len(values)), values)]

    def evaluate(self, function: ca.Function | symbolic.Part, t: Array, *inputs: Array) -> tuple[Array, ...]:
        """A function's outputs (N, rows, columns) at times (N,), in one mapped call."""
        return symbolic.evaluate(function, *inputs, *self.place(t))

    def positions(self, t: Array, *deviation: Array) -> tuple[Array, ...]:
        """s, s', s'' (N, arm.n) at times (N,), as many as there are parts y, y', y'' (N, n) given."""
        parts = [angles @ self._lead for angles, _ in zip(self.motion.sample(t), deviation, strict=False)]
        for part, extra in zip(parts, deviation, strict=True):
            part[:, self.kept] += extra
        return tuple(parts)

    @lazy
    def _lead(self) -> Array:
        """E' in numbers."""
        return np.asarray(self.arm.reference.full().T)

    def of_arm(self, name: str, t: Array, *deviation: Array) -> Array:
        """One of `arm.functions` at s = E q + P y and as many rates as it takes: (N, rows, columns)."""
        return self.at_positions(name, t, *self.positions(t, *deviation))

    def at_positions(self, name: str, t: Array, *positions: Array) -> Array:
        """The same at s and as many rates as it takes, (N, arm.n) each."""
        p = np.broadcast_to(self.arm.parameters.values, (len(t), len(self.arm.parameters.values)))
        function = self.arm.functions[name]
        phase = [self.motion.phase_of(t)[:, None]] if "phase" in function.name_in() else []
        return symbolic.evaluate(function, *positions, *phase, p)[0]


def loop_expressions(about: Deviation) -> tuple[dict[str, ca.SX], ca.SX, ca.SX, ca.SX]:
    """The inputs y, y', y'', torque; the angles; F = M s'' + C s' + g + d - B torque of the coordinates kept; the power where F = 0.

    power = s' (M s'' + C s' + g), in whose rows of coordinates kept B torque - d stands for the inertial forces.
    """
    arm, kept = about.arm, list(about.kept)
    y, rate, acceleration, angles = about.symbols()
    torque = ca.SX.sym("torque", about.m)
    given = arm.B[:, list(about.driven)] @ torque
    balance = ca.SX(arm.residual)
    balance[kept] = given[kept]
    expressions = [(arm.residual - given)[kept], ca.dot(arm.s_dot, balance - arm.damping)]
    F, power = about.lift(expressions, angles, y, rate, acceleration)
    return {"y": y, "y1": rate, "y2": acceleration, "torque": torque}, angles, F, power


def differentiate(F: ca.SX, inputs: dict[str, ca.SX]) -> dict[str, ca.SX]:
    """M, D, K, B: the slopes of F by y'', y' and y, and against the torque."""
    slopes = {name: ca.jacobian(F, inputs[by]) for name, by in (("M", "y2"), ("D", "y1"), ("K", "y"), ("B", "torque"))}
    return slopes | {"B": -slopes["B"]}
