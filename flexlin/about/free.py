"""A scene's closed loop with some of its numbers left free, and linearization about an elastic periodic motion."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.about.deviation import Deviation
from flexlin.about.linear import linearize
from flexlin.about.linearization import Linearization
from flexlin.about.periodic_motion import PeriodicMotion
from flexlin.arguments import checked, instance
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.mechanics.chain import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.periodic.related import extend_system
from flexlin.periodic.system import MatrixFunction, PeriodicSystem
from flexlin.scene.scene import Scene
from flexlin.summary import represent
from flexlin.symbolic import selected


@dataclass(frozen=True, eq=False)
class KeptGain:
    """A gain K(phase) [y; y'; z], designed once and kept while scene numbers vary; when the period changes, it follows the phase.

    `gain`: times (N,) in s -> (N, m, 2n + k); `period`: the period that it was made for; `breaks`: phases at which it loses smoothness;
    `rates`: of the design's own states, z' = rates [y; y'; z], (k, 2n + k); None where it has none.
    """

    gain: MatrixFunction
    period: float
    breaks: tuple[float, ...] = ()
    rates: Array | None = None

    @property
    def memory(self) -> int:
        """The number k of the design's own states."""
        return 0 if self.rates is None else len(self.rates)

    def at_phases(self, phases: Array) -> Array:
        """The gain (N, m, 2n + k) at phases (N,)."""
        return self.gain(np.mod(phases, 1.0) * self.period)

    def close(self, system: PeriodicSystem) -> PeriodicSystem:
        """The loop of this gain on a plant of any period."""
        corners = tuple(system.period * phase for phase in self.breaks)
        plant = system if self.rates is None else extend_system(system, self.rates)
        return plant.feedback(Stretched(self, system.period), corners)


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

    A controller's k states z are the rates of k further coordinates, behind the arm's n. These are ignorable: their columns of K are zero,
    so nothing depends on them, and x = [y; y'; z] leaves them out.
    `duration`: p -> T in s.
    """

    paths: tuple[str, ...]
    linearization: Linearization
    duration: ca.Function
    kept: KeptGain | None = None

    __repr__ = represent

    @lazy
    def matrices(self) -> ca.Function:
        """(phase, p) -> M, D, K, or (phase, p, gain) where a designed gain is kept; `inputs` makes its arguments."""
        return (
            closed_matrices(self.linearization) if self.kept is None else kept_matrices(self.linearization, self.kept)
        )

    @property
    def may_be_narrow(self) -> bool:
        """Whether the coefficients may have narrow features at some values."""
        return self.linearization.may_be_narrow

    @property
    def is_smooth(self) -> bool:
        """Whether narrow features are known where they are: an arm's equations name them."""
        return True

    def is_narrow(self, point: Array) -> bool:
        """Whether the coefficients have narrow features at one point (P,)."""
        return self.at(point).is_narrow

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
    def memory(self) -> int:
        """The number k of the controller's own states."""
        return self.linearization.states - 2 * self.linearization.n if self.kept is None else self.kept.memory

    @property
    def coordinates(self) -> int:
        """The number n + k of coordinates in `matrices`."""
        return self.linearization.n + self.memory

    @property
    def states(self) -> int:
        """The number of states, 2n + k."""
        return 2 * self.linearization.n + self.memory

    def periods(self, points: Array) -> Array:
        """T in s for points (V, P)."""
        return symbolic.evaluate(self.duration, points)[0][:, 0, 0]

    def sample(self, phases: Array, points: Array) -> tuple[Array, Array, Array]:
        """M, D, K (N V, n + k, n + k) at N phases times V points, the points running fastest."""
        M, D, K = symbolic.evaluate(self.matrices, *self.inputs(phases, points))
        return M, D, K

    def inputs(self, phases: Array, points: Array) -> list[Array]:
        """The arguments of `matrices` at N phases times V points, the points running fastest, (N V, rows) each."""
        of_phase = np.repeat(self.of_phase(phases), len(points), axis=0)
        gain = [] if self.kept is None else [of_phase[:, 1:]]
        return [of_phase[:, :1], np.tile(points, (len(phases), 1)), *gain]

    def of_phase(self, phases: Array) -> Array:
        """What of the arguments of `matrices` the phase decides: itself, and the kept gain column by column, (N, 1 + m (2n + k))."""
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
        """The loop u = -K(phase) [y; y'; z] on this arm. Assumes that this is the arm without feedback."""
        return replace(self, kept=kept)


def kept_matrices(lin: Linearization, kept: KeptGain) -> ca.Function:
    """(phase, p, gain) -> M, D, K of an arm without feedback under a gain."""
    gain = ca.SX.sym("gain", lin.about.m, 2 * lin.n + kept.memory)
    phase, p = lin.coefficients.sx_in()
    rates = ca.SX(0, 2 * lin.n) if kept.rates is None else ca.SX(kept.rates)
    closed = close_loop(lin, phase, p, gain, rates)
    return ca.Function("loop", [phase, p, ca.vec(gain)], closed, ["phase", "p", "gain"], ["M", "D", "K"])


def close_loop(lin: Linearization, phase: ca.SX, p: ca.SX, gain: ca.SX, rates: ca.SX) -> list[ca.SX]:
    """M, D, K of the loop u = -gain [y; y'; z], z' = rates [y; y'; z], z being the rates of ignorable coordinates behind y.

    [M 0; 0 I],   [D + B gain_y', B gain_z; -rates_y', -rates_z],   [K + B gain_y, 0; -rates_y, 0]
    """
    n, k = lin.n, rates.size1()
    M, D, K, _, B, _ = lin.coefficients.call([phase, p])
    M = ca.diagcat(M, ca.SX.eye(k))
    D = ca.vertcat(ca.horzcat(D + B @ gain[:, n : 2 * n], B @ gain[:, 2 * n :]), -rates[:, n:])
    K = ca.horzcat(ca.vertcat(K + B @ gain[:, :n], -rates[:, :n]), ca.SX(n + k, k))
    return [ca.densify(A) for A in (M, D, K)]


def closed_matrices(lin: Linearization) -> ca.Function:
    """(phase, p) -> M, D, K of a linearization, whose own D and K hold what answers at once; the controller's states go behind."""
    if lin.controller is None or lin.feedback is None:
        return selected(lin.coefficients, ("M", "D", "K"))
    phase, p = lin.coefficients.sx_in()
    gain, rates, _ = lin.feedback.function.call([p])
    gain[:, : 2 * lin.n] = 0
    return ca.Function("loop", [phase, p], close_loop(lin, phase, p, gain, rates), ["phase", "p"], ["M", "D", "K"])


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
    return ParametricLoop(lin.arm.parameters.paths, lin, duration)


@dataclass(frozen=True, eq=False)
class ElasticCoefficients:
    """M, D, K, B about a periodic motion of the elastic arm, as functions of time (N,).

    `slopes`: all four; `inertia`: M and B alone, for much less work.
    """

    motion: PeriodicMotion
    slopes: ca.Function
    inertia: ca.Function

    def sample(self, function: ca.Function, t: Array) -> tuple[Array, ...]:
        """The outputs of one of the functions at times (N,), in one mapped call."""
        motion = self.motion
        along = (motion.y(t), motion.y(t, 1), motion.y(t, 2), motion.torque(t))
        return motion.lin.about.evaluate(function, t, *along)

    def M(self, t: Array) -> Array:
        return self.sample(self.inertia, t)[0]

    def D(self, t: Array) -> Array:
        return self.sample(self.slopes, t)[1]

    def K(self, t: Array) -> Array:
        return self.sample(self.slopes, t)[2]

    def B(self, t: Array) -> Array:
        return self.sample(self.inertia, t)[1]

    def equations(self, t: Array) -> tuple[Array, Array, Array]:
        M, D, K, _ = self.sample(self.slopes, t)
        return M, D, K


@checked
def linearize_about(motion: PeriodicMotion, closed: bool = True) -> PeriodicSystem:
    """Linearize the equations about a periodic motion of the elastic arm itself.

        M z'' + D z' + K z = B u,   M = d r/d s'',  D = d r/d s',  K = d r/d s,   r = M(s) s'' + C s' + g + d - B(s) torque

    at s = s_R + y of the motion. The motion solves the equations, so nothing is left over on the right side (h = 0), and where
    the links are bent D is not zero even for a single link.

    Parameters
    ----------
    motion : PeriodicMotion
        From `periodic_motion` or from a feedforward.
    closed : bool
        With the scene's feedback, else the arm alone.

    Returns
    -------
    PeriodicSystem
        The system of [z; z'], followed by the states of the loop's controller, with input u the torque beside the motion's.

    Raises
    ------
    SingularMassMatrix
        When M cannot be inverted.

    References
    ----------
    Khang, Dat, Tuan (2019), section 4, with the elastic motion as basic motion.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> elastic = fl.control.linearize_about(fl.control.periodic_motion(lin, tol=1e-6))
    >>> fl.floquet(elastic, tol=1e-6).verdict
    'stable'
    """
    instance("motion", motion, PeriodicMotion, "give what periodic_motion hands back")
    lin = motion.lin
    made = slopes(lin.about)
    c = ElasticCoefficients(motion, made, selected(made, ("M", "B")))
    system = PeriodicSystem.from_second_order(c.M, c.D, c.K, lin.period, c.B, lin.breaks, c.equations)
    law = lin.law
    if not closed:
        return system
    open_loop = system if law.controller is None else extend_system(system, law.controller.rates)
    return open_loop.feedback(law.gain)


def slopes(about: Deviation) -> ca.Function:
    """M, D, K, B about s = s_R + y, as functions of y, y', y'', torque and the place on the motion."""
    arm, kept, driven = about.arm, list(about.kept), list(about.driven)
    *moved, angles = about.symbols()
    torque = ca.SX.sym("torque", about.m)
    inputs = arm.B[:, driven]
    left = arm.residual - inputs @ torque
    parts = [ca.jacobian(left, by)[kept, kept] for by in (arm.s_ddot, arm.s_dot, arm.s)]
    lifted = about.lift([*parts, inputs[kept, :]], angles, *moved)
    named = dict(zip(("y", "y1", "y2", "torque"), [*moved, torque], strict=True))
    return about.function(angles, named, dict(zip("MDKB", lifted, strict=True)))
