"""A scene's closed loop with some of its numbers left free: one set of expressions for all their values."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.linear import Linearization, linearize
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.mechanics.chain import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.scene.scene import Scene


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
        parameters = replace(lin.arm.parameters, values=point)
        period = float(self.periods(point[None])[0])
        motion = replace(lin.motion, period=period, breaks=tuple(period * phase for phase in self.phase_breaks))
        assert isinstance(motion, SymbolicMotion)
        motion = replace(motion, parameters=parameters)
        return replace(lin, arm=replace(lin.arm, parameters=parameters), motion=motion)


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
    lin = linearize(arm, scene.motion, arm.parameters.placed_in(scene.control, "control."))
    if not isinstance(lin.motion, SymbolicMotion) or not lin.motion.periodic:
        raise ArgumentError("parameters need a periodic motion that is an expression", got=scene.motion.kind)
    inputs = lin.coefficients.sx_in()
    M, D, K = lin.coefficients.call(inputs)[:3]
    return ParametricLoop(
        paths,
        lin,
        ca.Function("matrices", inputs, [M, D, K], ["phase", "p"], ["M", "D", "K"]),
        ca.Function("duration", inputs[1:], [duration_of(lin, inputs[1])], ["p"], ["T"]),
    )


def duration_of(lin: Linearization, p: ca.SX) -> ca.SX:
    """The period as expression of p."""
    assert isinstance(lin.motion, SymbolicMotion)
    return ca.densify(ca.substitute(ca.SX(lin.motion.duration), lin.arm.parameters.symbols, p))
