"""The bridge: a manipulator linearized along its rigid basic motion, M_L y'' + D_L y' + K_L y = h_L + B_L u."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
from numpy.typing import ArrayLike

from flexlin.about.deviation import Deviation
from flexlin.about.law import Law
from flexlin.about.routes import Route
from flexlin.about.scene_law import scene_law
from flexlin.checks import Array, at_times, times
from flexlin.errors import MotionError
from flexlin.mechanics.coordinates import Coordinate
from flexlin.mechanics.effects import Effect, effects_of
from flexlin.mechanics.effects.narrow import Features
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion
from flexlin.periodic.companion import build_companion, build_input
from flexlin.periodic.system import PeriodicSystem, SecondOrder
from flexlin.scene.control import Control
from flexlin.scene.parameters import replace_value
from flexlin.symbolic import selected


@dataclass(frozen=True)
class Coefficients:
    """M_L, D_L, K_L (N, n, n), h_L (N, n), B_L (N, n, m) and the feedforward torque of the rigid motion tau (N, m), at N times."""

    M: Array
    D: Array
    K: Array
    h: Array
    B: Array
    tau: Array


@dataclass(frozen=True, eq=False)
class Linearization:
    """The linear equations of the small motion y about the rigid basic motion s_R.

        M_L(t) y'' + D_L(t) y' + K_L(t) y = h_L(t) + B_L(t) u,     s = s_R + y

    Without a loop h_L = -(M s_R'' + C s_R' + g + d) and u is the whole torque. With a loop, torque = feedforward + feedback + u:
    D_L and K_L hold the feedback, h_L the feedforward.

    `M(t)`, `D(t)`, `K(t)` (N, n, n), `h(t)` (N, n), `B(t)` (N, n, m) take times t (N,) in s, or one time, and then give one matrix.
    `about` is the deviation they are written in; `coefficients` the function of the place on the motion that holds them all.
    """

    about: Deviation
    coefficients: ca.Function
    route: Route
    control: Control | None = None

    @property
    def arm(self) -> Manipulator:
        """The manipulator."""
        return self.about.arm

    @property
    def motion(self) -> Motion:
        """The rigid basic motion."""
        return self.about.motion

    @property
    def kept(self) -> tuple[int, ...]:
        """Which coordinates of the arm are in y."""
        return self.about.kept

    @property
    def driven(self) -> tuple[int, ...]:
        """Which joints a torque drives."""
        return self.about.driven

    @property
    def period(self) -> float:
        """The period of the basic motion, in s."""
        return self.motion.period

    @property
    def n(self) -> int:
        """The number of coordinates of the linear equations."""
        return self.about.n

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """What each coordinate of y is."""
        return tuple(self.arm.coordinates[k] for k in self.kept)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates y."""
        return tuple(self.arm.names[k] for k in self.kept)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the coordinates that the inputs drive."""
        return tuple(self.arm.names[self.arm.drives[i]] for i in self.driven)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in [0, T) at which the coefficients lose smoothness."""
        return self.motion.breaks

    @property
    def features(self) -> Features:
        """Pairs (time, half-width) in s about which the coefficients change fast: what motion and effects know of it."""
        found = [
            *self.motion.features,
            *(pair for effect in self._effects or () for pair in effect.features(self.motion)),
        ]
        return tuple(sorted(found))

    @property
    def may_be_narrow(self) -> bool:
        """Whether an effect in the arm may have features, for some values of its numbers."""
        return any(type(effect).features is not Effect.features for effect in self._effects or ())

    @property
    def complete(self) -> bool:
        """Whether breaks and features name everything in the coefficients that is narrower than T/200."""
        effects = self._effects
        return effects is not None and self.motion.complete and all(effect.smooth for effect in effects)

    @property
    def _effects(self) -> tuple[Effect, ...] | None:
        """The effects in the arm with the present values of its free numbers; None where they are not known."""
        arm, tables = self.arm, self.arm.effects
        if tables is None:
            return None
        for path, value in zip(arm.parameters.paths, arm.parameters.values, strict=True):
            if path.startswith("effects."):
                tables = replace_value(tables, path.removeprefix("effects."), float(value))
        return effects_of(tables)

    @property
    def closed_by(self) -> Law:
        """The law that the linear equations hold: the scene's, or no torque at all where they were made without one."""
        return scene_law(self.about, self.control, self.feedforward)

    @property
    def law(self) -> Law:
        """The law that runs on the arm unless another is given: the scene's, or the torque of the rigid motion alone."""
        return scene_law(self.about, self.control or Control(), self.feedforward)

    def sample(self, t: Array) -> Coefficients:
        """All coefficients at the times t (N,), in one mapped call."""
        M, D, K, h, B, tau = self.about.evaluate(self.coefficients, times(t))
        return Coefficients(M, D, K, h[:, :, 0], B, tau[:, :, 0])

    def M(self, t: ArrayLike) -> Array:
        """The mass matrix, Eq. (65)."""
        return at_times(lambda t: self.mass_and_input(t)[0], t)

    def D(self, t: ArrayLike) -> Array:
        """The matrix of y', Eq. (66)."""
        return at_times(lambda t: self.equations(t)[1], t)

    def K(self, t: ArrayLike) -> Array:
        """The matrix of y, Eq. (67)."""
        return at_times(lambda t: self.equations(t)[2], t)

    def h(self, t: ArrayLike) -> Array:
        """The forcing that the rigid motion leaves over, Eq. (64)."""
        return at_times(lambda t: self.sample(t).h, t)

    def B(self, t: ArrayLike) -> Array:
        """The input matrix."""
        return at_times(lambda t: self.mass_and_input(t)[1], t)

    def feedforward(self, t: ArrayLike) -> Array:
        """The torque of the rigid motion, (N, m) in N m: what the arm would need if its links were rigid."""
        return at_times(lambda t: self.about.evaluate(self._torque, t)[0][:, :, 0], t)

    def equations(self, t: Array) -> tuple[Array, Array, Array]:
        """M, D, K at the times t (N,), without the rest."""
        M, D, K = self.about.evaluate(self._equations, times(t))
        return M, D, K

    def mass_and_input(self, t: Array) -> tuple[Array, Array]:
        """M and B at the times t (N,), without the rest."""
        M, B = self.about.evaluate(self._inputs, times(t))
        return M, B

    def periodic_system(self) -> PeriodicSystem:
        """The linear system x' = A(t) x + B(t) u with x = [y; y'].

        Raises: MotionError for a one-way motion, which has no period.
        """
        if not self.motion.periodic:
            raise MotionError(
                "a one-way motion has no period",
                got="course = 'one-way'",
                expected="a periodic basic motion",
                todo="use course = 'there-and-back', or a finite-horizon design",
            )
        force, B = (self.B, self.input_matrix) if self.about.m else (None, None)
        second_order = SecondOrder(self.M, self.D, self.K, force, self.equations)
        named = self.features, self.complete
        return PeriodicSystem(self.state_matrix, self.period, B, self.breaks, second_order, *named)

    def state_matrix(self, t: Array) -> Array:
        """A = [[0, I], [-M^-1 K, -M^-1 D]], (N, 2n, 2n)."""
        return build_companion(*self.equations(t), t)

    def input_matrix(self, t: Array) -> Array:
        """[0; M^-1 B], (N, 2n, m)."""
        return build_input(*self.mass_and_input(t), t)

    def forcing(self, t: Array) -> Array:
        """M_L^-1 h_L in state form, (N, 2n): x' = A x + forcing."""
        c = self.sample(t)
        return build_input(c.M, c.h[:, :, None], t)[:, :, 0]

    @cached_property
    def _equations(self) -> ca.Function:
        return selected(self.coefficients, ("M", "D", "K"))

    @cached_property
    def _inputs(self) -> ca.Function:
        return selected(self.coefficients, ("M", "B"))

    @cached_property
    def _torque(self) -> ca.Function:
        return selected(self.coefficients, ("tau",))
