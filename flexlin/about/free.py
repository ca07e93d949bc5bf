"""A scene's closed loop with some of its numbers left free: one set of expressions for all their values."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.chain import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.periodic.system import MatrixFunction, PeriodicSystem
from flexlin.scene.scene import Scene
from flexlin.summary import represent
from flexlin.symbolic import selected


@dataclass(frozen=True, eq=False)
class KeptGain:
    """A gain K(phase) [y; y'] that was designed once and is kept while scene numbers vary; when the period changes, it follows the phase.

    `gain`: times (N,) in s -> (N, m, 2n); `period`: the period that it was made for; `breaks`: phases at which it loses smoothness.
    """

    gain: MatrixFunction
    period: float
    breaks: tuple[float, ...] = ()

    def at_phases(self, phases: Array) -> Array:
        """The gain (N, m, 2n) at phases (N,)."""
        return self.gain(np.mod(phases, 1.0) * self.period)

    def close(self, system: PeriodicSystem) -> PeriodicSystem:
        """The loop of this gain on a plant of any period."""
        corners = tuple(system.period * phase for phase in self.breaks)
        return system.feedback(Stretched(self, system.period), corners)


@dataclass(frozen=True, eq=False)
class Stretched:
    """A kept gain as a function of times in another period."""

    kept: KeptGain
    period: float

    def __call__(self, t: Array) -> Array:
        return self.kept.at_phases(t / self.period)


@dataclass(frozen=True, eq=False)
class ParametricLoop:
    """The linear equations of one loop on a scene's arm as functions of the phase t/T and of free scene numbers p.

        M(phase, p) y'' + D(phase, p) y' + K(phase, p) y = 0,   T = T(p)

    `matrices`: (phase, p) -> M, D, K, or (phase, p, gain) where a designed gain is kept; `inputs` makes its arguments.
    `duration`: p -> T in s.
    """

    paths: tuple[str, ...]
    linearization: Linearization
    matrices: ca.Function
    duration: ca.Function
    kept: KeptGain | None = None

    __repr__ = represent

    @property
    def nominal(self) -> Array:
        """The scene's own values of the free numbers, (P,)."""
        return self.linearization.arm.parameters.values

    @property
    def phase_breaks(self) -> tuple[float, ...]:
        """Phases in [0, 1) at which the coefficients lose smoothness."""
        own = tuple(t / self.linearization.period for t in self.linearization.breaks)
        return own if self.kept is None else tuple(sorted({*own, *self.kept.breaks}))

    @property
    def states(self) -> int:
        """The number of states, 2n."""
        return 2 * self.linearization.n

    def periods(self, points: Array) -> Array:
        """T in s for points (V, P)."""
        return symbolic.evaluate(self.duration, points)[0][:, 0, 0]

    def sample(self, phases: Array, points: Array) -> tuple[Array, Array, Array]:
        """M, D, K (N V, n, n) at N phases times V points, the points running fastest."""
        M, D, K = symbolic.evaluate(self.matrices, *self.inputs(phases, points))
        return M, D, K

    def inputs(self, phases: Array, points: Array) -> list[Array]:
        """The arguments of `matrices` at N phases times V points, the points running fastest, (N V, rows) each."""
        of_phase = np.repeat(self.of_phase(phases), len(points), axis=0)
        gain = [] if self.kept is None else [of_phase[:, 1:]]
        return [of_phase[:, :1], np.tile(points, (len(phases), 1)), *gain]

    def of_phase(self, phases: Array) -> Array:
        """What of the arguments of `matrices` the phase decides: itself, and the kept gain column by column, (N, 1 + 2 n m)."""
        if self.kept is None:
            return phases[:, None]
        gain = np.swapaxes(self.kept.at_phases(phases), 1, 2).reshape(len(phases), -1)
        return np.column_stack([phases, gain])

    def at(self, point: Array) -> Linearization:
        """The linearization at one point (P,)."""
        return self.linearization.at_numbers(point, float(self.periods(point[None])[0]))

    def system_at(self, point: Array) -> PeriodicSystem:
        """The loop as a periodic system at one point (P,); with a kept gain the plant is closed by it."""
        system = self.at(point).periodic_system()
        return system if self.kept is None else self.kept.close(system)

    def with_gain(self, kept: KeptGain) -> "ParametricLoop":
        """The loop u = -K(phase) [y; y'] on this arm: D + B K_v, K + B K_y. Assumes that this is the arm without feedback."""
        about = self.linearization.about
        gain = ca.SX.sym("gain", about.m, 2 * about.n)
        phase, p = self.linearization.coefficients.sx_in()
        M, D, K, _, B, _ = self.linearization.coefficients.call([phase, p])
        closed = [M, D + B @ gain[:, about.n :], K + B @ gain[:, : about.n]]
        inputs, names = [phase, p, ca.vec(gain)], ["phase", "p", "gain"]
        matrices = ca.Function("loop", inputs, [ca.densify(A) for A in closed], names, ["M", "D", "K"])
        return replace(self, matrices=matrices, kept=kept)


def parametric_loop(scene: Scene, paths: Iterable[str], *, closed: bool = True) -> ParametricLoop:
    """Linearize a scene's own loop, or the arm without feedback, with the numbers at the dotted paths left free.

    Paths may lead into links, effects, motion and control: `effects.payload.mass`, `motion.frequency`, `control.feedback.kp.0`.
    Assumes mode shapes as the scene's own numbers give them: a free number moves the energies, not the shapes.

    Raises: ArgumentError for a path that leads to no free number, one that moves the breaks of the motion, or a motion given by samples.
    """
    paths = tuple(paths)
    moving = [path for path in paths if path in ("motion.move_time", "motion.dwell_time")]
    if moving:
        raise ArgumentError("this number moves the breaks of the motion and cannot be free", got=", ".join(moving))
    arm = build_manipulator(scene, paths)
    return loop_of(linearize(arm, scene.motion, scene.control if closed else None))


def loop_of(lin: Linearization) -> ParametricLoop:
    """The linear equations of an arm whose numbers were left free, for all their values.

    Raises: ArgumentError for a motion that is given by samples, or ends.
    """
    if not isinstance(lin.motion, SymbolicMotion) or not lin.motion.periodic:
        raise ArgumentError("parameters need a periodic motion that is an expression", got=repr(lin.motion))
    motion = lin.motion
    duration = ca.Function("duration", [motion.parameters.symbols], [ca.densify(motion.duration)], ["p"], ["T"])
    return ParametricLoop(lin.arm.parameters.paths, lin, selected(lin.coefficients, ("M", "D", "K")), duration)
