"""A scene's closed loop with some of its numbers left free; it and families as data for the kernel."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntFlag, auto
from functools import lru_cache, partial
from typing import ClassVar

import casadi as ca
import numpy as np

from flexlin import symbolic
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.lazy import lazy
from flexlin.linearization.family import PeriodicFamily
from flexlin.linearization.linear import linearize, need_sound
from flexlin.linearization.linearization import Linearization
from flexlin.mechanics.chain import build_manipulator
from flexlin.motion import SymbolicMotion
from flexlin.periodic.many import SIZES, Kernel, Model, take_phases
from flexlin.periodic.system import MatrixFunction, PeriodicSystem, extend_system
from flexlin.program import INPUT, OUTPUT, Program
from flexlin.scene.scene import Scene
from flexlin.summary import immutable
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

    def at_phases(self, t: Array, period: float = 1.0) -> Array:
        """The gain (N, m, 2n + k) at times (N,) in another period, or at phases."""
        return self.gain(np.mod(t / period, 1.0) * self.period)

    def close(self, system: PeriodicSystem) -> PeriodicSystem:
        """The loop of this gain on a plant of any period."""
        corners = tuple(system.period * phase for phase in self.breaks)
        plant = system if self.rates is None else extend_system(system, self.rates)
        return plant.feedback(partial(self.at_phases, period=system.period), corners)


@immutable(eq=False)
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

    is_smooth: ClassVar[bool] = True  # an arm's equations name their narrow features

    @lazy
    def matrices(self) -> ca.Function:
        """(phase, p) -> M, D, K, or (phase, p, gain) where a designed gain is kept."""
        return loop_matrices(self.linearization, self.kept)

    @property
    def may_be_narrow(self) -> bool:
        """Whether the coefficients may have narrow features at some values."""
        return self.linearization.may_be_narrow

    def is_narrow(self, point: Array) -> bool:
        """Whether the coefficients have narrow features at one point (P,)."""
        return bool(linearize_at(self, *point.tolist()).features)

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
        of_phase = np.repeat(self.of_phase(phases), len(points), axis=0)
        gain = [] if self.kept is None else [of_phase[:, 1:]]
        M, D, K = symbolic.evaluate(self.matrices, of_phase[:, :1], np.tile(points, (len(phases), 1)), *gain)
        return M, D, K

    def of_phase(self, phases: Array) -> Array:
        """What of the arguments of `matrices` the phase decides: itself, and the kept gain column by column, (N, 1 + m (2n + k))."""
        if self.kept is None:
            return phases[:, None]
        gain = np.swapaxes(self.kept.at_phases(phases), 1, 2).reshape(len(phases), -1)
        return np.column_stack([phases, gain])

    def at(self, point: Array) -> Linearization:
        """The linearization at one point (P,): the same one where it is asked for again, with all that is known of it then.

        Raises: ModelError, as `linearize` does, where its equations break or M is indefinite.
        """
        lin = linearize_at(self, *point.tolist())
        need_sound(lin)
        return lin

    def system_at(self, point: Array) -> PeriodicSystem:
        """The loop as a periodic system at one point (P,); with a kept gain the plant is closed by it."""
        system = self.at(point).periodic_system()
        return system if self.kept is None else self.kept.close(system)


@lru_cache(maxsize=16)
def linearize_at(loop: ParametricLoop, *numbers: float) -> Linearization:
    """The linearization of a loop at some numbers (kept: a scan asks for features, a loose spectrum and a better one), sound or not."""
    point = np.array(numbers)
    return loop.linearization.at_numbers(point, float(loop.periods(point[None])[0]))


def loop_matrices(lin: Linearization, kept: KeptGain | None) -> ca.Function:
    """(phase, p) -> M, D, K of a linearization, or (phase, p, gain) of an arm without feedback under a kept gain.

        [M 0; 0 I],   [D + B gain_y', B gain_z; -rates_y', -rates_z],   [K + B gain_y, 0; -rates_y, 0]

    of the loop u = -gain [y; y'; z], z' = rates [y; y'; z], z being the rates of ignorable coordinates behind y. What of a scene's own
    gain answers at once stands in D and K already.
    """
    if kept is None and (lin.controller is None or lin.feedback is None):
        return selected(lin.coefficients, ("M", "D", "K"))
    n, inputs = lin.n, lin.coefficients.sx_in()
    M, D, K, _, B, _ = lin.coefficients.call(inputs)
    if kept is None:
        assert lin.feedback is not None
        gain, rates, _ = lin.feedback.function.call(inputs[1:])
        gain[:, : 2 * n] = 0
    else:
        gain = ca.SX.sym("gain", lin.about.m, 2 * n + kept.memory)
        rates = ca.SX(0, 2 * n) if kept.rates is None else ca.SX(kept.rates)
        inputs.append(ca.vec(gain))
    k = rates.size1()
    M = ca.diagcat(M, ca.SX.eye(k))
    D = ca.vertcat(ca.horzcat(D + B @ gain[:, n : 2 * n], B @ gain[:, 2 * n :]), -rates[:, n:])
    K = ca.horzcat(ca.vertcat(K + B @ gain[:, :n], -rates[:, :n]), ca.SX(n + k, k))
    names = ["phase", "p", "gain"][: len(inputs)]
    return ca.Function("loop", inputs, [ca.densify(A) for A in (M, D, K)], names, ["M", "D", "K"])


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


@lru_cache(maxsize=8)
def loop_of(lin: Linearization) -> ParametricLoop:
    """The linear equations of an arm whose numbers were left free, for all their values (kept, with its kernel: a report asks for several).

    Raises: ArgumentError for a motion that is given by samples, or ends.
    """
    if not isinstance(lin.motion, SymbolicMotion) or not lin.motion.periodic:
        raise ArgumentError("parameters need a periodic motion that is an expression", got=repr(lin.motion))
    motion = lin.motion
    duration = ca.Function("duration", [motion.parameters.symbols], [ca.densify(motion.duration)], ["p"], ["T"])
    return ParametricLoop(lin.arm.parameters.paths, lin, duration)


class Needs(IntFlag):
    """What a value depends on."""

    PHASE = auto()
    POINT = auto()


@lru_cache(maxsize=8)
def make_kernel(source: ParametricLoop | PeriodicFamily) -> Kernel:
    """The kernel of a loop or a family (kept: it takes longer to make than some values).

    Raises: ArgumentError where an expression holds an operation that the kernel does not know, and where breaks move.
    """
    if isinstance(source, PeriodicFamily):
        if source.phase_breaks is None:
            raise ArgumentError("the breaks move with the parameters")
        return Kernel(record_model(family_equations(source), 1), take_phases, source.phase_breaks)
    of_phase = take_phases if source.kept is None else source.of_phase
    inputs = 1 if source.kept is None else 1 + source.states * source.linearization.about.m
    return Kernel(record_model(state_equations(source), inputs), of_phase, source.phase_breaks)


def state_equations(loop: ParametricLoop) -> ca.Function:
    """(phase, p[, gain]) -> Z', M', T: a loop's equations M y'' = Z [y; y'] in units of its period.

    A controller's states z, whose coordinates are ignorable, make A full: x = [y; y'; z] leaves those coordinates out.
    """
    inputs = loop.matrices.sx_in()
    M, D, K = loop.matrices.call(inputs)
    T, n, k = loop.duration(inputs[1]), loop.coordinates, loop.memory
    Z = ca.horzcat(-(T**2) * K, -T * D)
    if k:
        M = ca.diagcat(ca.SX.eye(n - k), M)
        Z = ca.vertcat(ca.SX.eye(2 * n - k)[n - k : 2 * (n - k), :], Z[:, [*range(n - k), *range(n, 2 * n)]])
    return ca.Function("equations", inputs, [ca.densify(Z.T), ca.densify(M.T), T])


def family_equations(family: PeriodicFamily) -> ca.Function:
    """(phase, p) -> Z', M', T: a family's equations in units of its period; M' is empty where A is given."""
    phase, p = ca.SX.sym("phase"), family.p
    T = family.durations(p)[0]
    first, *more = family.coefficients.call([phase * T, p])[: len(family.matrices)]
    Z = ca.horzcat(-(T**2) * more[1], -T * more[0]) if more else T * first
    return ca.Function("equations", [phase, p], [ca.densify(Z.T), ca.densify(first.T) if more else ca.SX(0, 0), T])


def record_model(function: ca.Function, phase_inputs: int) -> Model:
    """The model of (phase, p[, more of the phase]) -> Z', M' (dense, or empty for I), T: column by column is then row by row.

    Raises: ArgumentError for a size of which there is no kernel, and for an operation that it does not know.
    """
    kinds = tuple(Needs.POINT if i == 1 else Needs.PHASE for i in range(function.n_in()))
    states, rows = size = function.size_out(0)
    if size not in SIZES:
        raise ArgumentError("there is no kernel of this size", got=size, expected=f"one of {SIZES}")
    program = Program.read(function)
    program.check_known()
    code, needs, (Z, M, period) = program.steps[:, 0], program.find_needs(kinds), program.find_outputs()
    wanted = np.concatenate([Z, M, program.steps[(needs == Needs.PHASE | Needs.POINT) & (code != OUTPUT), 2:].ravel()])
    of_phase, of_point = (np.unique(wanted[np.isin(needs[wanted], kind)]) for kind in (Needs.PHASE, (Needs.POINT, 0)))
    phase = program.lay_out((), of_phase, place_inputs(program, [i for i in range(len(kinds)) if i != 1]), phase_inputs)
    point = program.lay_out((), np.append(of_point, period), place_inputs(program, [1]), function.numel_in(1))
    given = {value: slot for slot, value in enumerate([*of_point.tolist(), *of_phase.tolist()])}
    both = program.lay_out((), np.append(Z, M), given, len(given))
    return Model(
        states,
        rows,
        *(phase.steps, point.steps, both.steps),
        *(phase.places[of_phase], point.places[of_point], both.places[np.append(Z, M)]),
        phase_inputs,
        function.numel_in(1),
        int(point.places[period[0]]),
        max(phase.slots, point.slots, both.slots, 1),
    )


def place_inputs(program: Program, arguments: list[int]) -> dict[int, int]:
    """The slots of the values of some arguments, which stand in a row."""
    starts = dict(zip(arguments, np.cumsum([0, *program.rows[arguments]]).tolist(), strict=False))
    inputs = program.steps[program.steps[:, 0] == INPUT, 1:].tolist()
    return {k: starts[a] + b for k, a, b in inputs if a in starts}
