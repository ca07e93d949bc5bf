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
from flexlin.scene.scene import Scene
from flexlin.summary import represent
from flexlin.symbolic import selected


@dataclass(frozen=True, eq=False)
class ParametricLoop:
    """The linear equations of a scene's own loop as functions of the phase t/T and of free scene numbers p.

        M(phase, p) y'' + D(phase, p) y' + K(phase, p) y = 0,   T = T(p)

    `matrices`: (phase, p) -> M, D, K; `duration`: p -> T in s.
    """

    paths: tuple[str, ...]
    linearization: Linearization
    matrices: ca.Function
    duration: ca.Function

    __repr__ = represent

    @property
    def nominal(self) -> Array:
        """The scene's own values of the free numbers, (P,)."""
        return self.linearization.arm.parameters.values

    @property
    def phase_breaks(self) -> tuple[float, ...]:
        """Phases in [0, 1) at which the coefficients lose smoothness."""
        return tuple(t / self.linearization.period for t in self.linearization.breaks)

    def periods(self, points: Array) -> Array:
        """T in s for points (V, P)."""
        return symbolic.evaluate(self.duration, points)[0][:, 0, 0]

    def sample(self, phases: Array, points: Array) -> tuple[Array, Array, Array]:
        """M, D, K (N V, n, n) at N phases times V points, the points running fastest."""
        place = np.repeat(phases, len(points))[:, None]
        M, D, K = symbolic.evaluate(self.matrices, place, np.tile(points, (len(phases), 1)))
        return M, D, K

    def at(self, point: Array) -> Linearization:
        """The linearization at one point (P,)."""
        lin = self.linearization
        about, parameters = lin.about, replace(lin.arm.parameters, values=point)
        period = float(self.periods(point[None])[0])
        motion = replace(about.motion, period=period, breaks=tuple(period * phase for phase in self.phase_breaks))
        assert isinstance(motion, SymbolicMotion)
        motion = replace(motion, parameters=replace(motion.parameters, values=point))
        return replace(lin, about=replace(about, arm=replace(about.arm, parameters=parameters), motion=motion))


def parametric_loop(scene: Scene, paths: Iterable[str]) -> ParametricLoop:
    """Linearize a scene's own loop with the numbers at the dotted paths left free.

    Paths may lead into links, effects, motion and control: `effects.payload.mass`, `motion.frequency`, `control.feedback.kp.0`.
    Assumes mode shapes as the scene's own numbers give them: a free number moves the energies, not the shapes.

    Raises: ArgumentError for a path that leads to no free number, one that moves the breaks of the motion, or a motion given by samples.
    """
    paths = tuple(paths)
    moving = [path for path in paths if path in ("motion.move_time", "motion.dwell_time")]
    if moving:
        raise ArgumentError("this number moves the breaks of the motion and cannot be free", got=", ".join(moving))
    arm = build_manipulator(scene, paths)
    lin = linearize(arm, scene.motion, scene.control)
    if not isinstance(lin.motion, SymbolicMotion) or not lin.motion.periodic:
        raise ArgumentError("parameters need a periodic motion that is an expression", got=scene.motion.kind)
    motion = lin.motion
    duration = ca.Function("duration", [motion.parameters.symbols], [ca.densify(motion.duration)], ["p"], ["T"])
    return ParametricLoop(paths, lin, selected(lin.coefficients, ("M", "D", "K")), duration)
