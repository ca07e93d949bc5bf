"""The equations of a loop in one of its modes: inputs held at a limit or on a ramp, joints that stick or slide one way."""

from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.deviation import Deviation
from flexlin.about.law import Law
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.lazy import lazy
from flexlin.simulation.equations import ControlledEquations, Equations, NonlinearEquations, Places, loop_expressions
from flexlin.simulation.friction import Friction


@dataclass
class Modes:
    """What the m inputs and the p joints that may stick do, from one event to the next.

    held: 0 where an input follows the law, 1 or -1 at its limit, 2 or -2 where it changes as fast as it may; held inputs give
    base + ramp (t - since); slip: 0 where a joint sticks, else the sign of its rate.
    """

    held: Array
    base: Array
    ramp: Array
    since: Array
    slip: Array

    @classmethod
    def free(cls, inputs: int, joints: int) -> "Modes":
        """All inputs follow the law; joints stick."""
        held, base, ramp, since = np.zeros((4, inputs))
        return cls(held, base, ramp, since, np.zeros(joints))

    def copy(self) -> "Modes":
        """As they are now."""
        return Modes(*(part.copy() for part in vars(self).values()))

    def given(self, t: Array, asked: Array) -> Array:
        """The torque (.., m) at times t (..) at which the law asks for `asked`."""
        return np.where(self.held == 0, asked, self.base + self.ramp * (t[..., None] - self.since))


class ModedEquations(NonlinearEquations):
    """The nonlinear equations of the arm in the present modes, which others change between windows.

    sliding:  M s'' + C s' + g + d + sign F_sliding = B torque;   sticking: s'' = 0 for the joint instead
    """

    def __init__(self, lin: Linearization, law: Law, modes: Modes, friction: Friction | None):
        super().__init__(lin, law)
        self.modes, self._friction = modes, friction
        if friction is not None:
            self._residual = moded_functions(lin.about, friction)[0]

    @lazy
    def _slopes(self) -> ca.Function:
        return super()._slopes if self._friction is None else moded_functions(self.lin.about, self._friction)[1]

    def places(self, t: Array) -> Places:
        """What of the law is followed, and the equations about y = 0."""
        law, now, modes, place = self.law, self.now(t), self.modes, self.lin.about.place(t)
        if self._friction is not None:
            place.insert(0, np.tile(modes.slip, (len(t), 1)))
        gain = np.where(modes.held[:, None] == 0, law.gain(now), 0.0)
        rest = np.zeros((len(t), self.lin.n))
        at = Places(t, place, gain, modes.given(t, law.offset(now)), (rest, rest, rest), rest)
        at = replace(at, linear=self.slopes(at, rest, rest, rest))
        return replace(at, force=-self.residual(at, rest, rest, rest)[0])

    def mass(self, at: Places, y: Array) -> Array:
        """dF/dy'', whose rows of joints that stick are those of the unit matrix."""
        return self.slopes(at, y, np.zeros_like(y), np.zeros_like(y))[0]

    def input_matrix(self, at: Places) -> Array:
        """B at y = 0, without joints that stick."""
        rest = np.zeros((len(at.t), self.lin.n))
        return self.at_places(self._slopes, at, rest, rest, rest)[3]


def with_modes(arm: ModedEquations, law: Law) -> Equations:
    """The equations under a law in the present modes, with what its controller remembers."""
    return arm if law.controller is None else ModedController(arm, law)


class ModedController(ControlledEquations):
    """A controller some of whose torques are not given.

    z' = rates [[y; y'] - reference; z] + unwinding (asked - given)
    """

    def rates(self, t: Array) -> tuple[Array, Array]:
        """What the states (2n + k) and the time alone put into z', (N, k, 2n + k) and (N, k)."""
        rates, steer = super().rates(t)
        arm, law = self._arm, self._law
        assert isinstance(arm, ModedEquations)
        modes, now, unwinding = arm.modes, arm.now(t), self._controller.unwinding
        offset, missing = law.offset(now), unwinding * (modes.held != 0)
        return rates - missing @ law.gain(now), steer + (offset - modes.given(t, offset)) @ unwinding.T

    def steering(self, t: Array) -> Array:
        """The gain on z (N, m, k) of inputs that follow the law."""
        assert isinstance(self._arm, ModedEquations)
        return np.where(self._arm.modes.held[:, None] == 0, super().steering(t), 0.0)


@lru_cache(maxsize=8)
def moded_functions(about: Deviation, friction: Friction) -> tuple[ca.Function, ca.Function]:
    """F and the power of y, y', y'', the torque, the slip and the place on the motion; and dF/dy'', dF/dy', dF/dy, -dF/dtorque."""
    inputs, angles, F, _, power = loop_expressions(about)
    slip, places = ca.SX.sym("slip", len(friction.rows)), list(friction.places)
    expressions = [about.arm.s_dot[places], about.arm.s_ddot[places]]
    rates, accelerations = about.lift(expressions, angles, *(inputs[name] for name in ("y", "y1", "y2")))
    slides = slip**2
    for i, row in enumerate(friction.rows):
        sliding = friction.level(i, rates[i])
        left = F[row] + (slip[i] - ca.tanh(rates[i] / friction.rate[i])) * sliding
        F[row] = slides[i] * left + (1 - slides[i]) * accelerations[i]
    slopes = {name: ca.jacobian(F, inputs[by]) for name, by in (("M", "y2"), ("D", "y1"), ("K", "y"))}
    slopes["B"] = -ca.jacobian(F, inputs["torque"])
    inputs["slip"] = slip
    return about.function(angles, inputs, {"F": F, "power": power}), about.function(angles, inputs, slopes)


@lru_cache(maxsize=8)
def holding_function(about: Deviation, friction: Friction) -> ca.Function:
    """The friction (p,) that the joints would need at these accelerations, of y, y', y'', the torque and the place on the motion."""
    inputs, angles, F, _, _ = loop_expressions(about)
    rates = about.lift([about.arm.s_dot[list(friction.places)]], angles, inputs["y"], inputs["y1"])[0]
    smooth = [friction.level(i, rates[i]) * ca.tanh(rates[i] / friction.rate[i]) for i in range(len(friction.rows))]
    return about.function(angles, inputs, {"holding": ca.vertcat(*smooth) - F[list(friction.rows)]})


def find_holding(about: Deviation, friction: Friction, t: Array, parts: tuple[Array, ...], torque: Array) -> Array:
    """The friction (N, p) that joints need at times t (N,) in a motion y, y', y'' (N, n) under a torque (N, m)."""
    found = symbolic.call(holding_function(about, friction), [*parts, torque, *about.place(t)])[0]
    return np.asarray(found[:, :, 0])
