"""The coefficients of a parametric system as data for the kernel, parted into what the phase, the parameters, or both decide."""

import casadi as ca
import numpy as np

from flexlin.about.family import PeriodicFamily
from flexlin.about.free import ParametricLoop
from flexlin.errors import ArgumentError
from flexlin.periodic.many import Kernel, Model, take_phases
from flexlin.program import INPUT, OUTPUT, Program

PHASE, POINT = 1, 2
"""What a value depends on, as bits."""


def make_kernel(source: ParametricLoop | PeriodicFamily) -> Kernel:
    """The kernel of a loop or a family.

    Raises: ArgumentError where an expression holds an operation that the kernel does not know, and where breaks move.
    """
    if isinstance(source, PeriodicFamily):
        if source.phase_breaks is None:
            raise ArgumentError("the breaks move with the parameters")
        return Kernel(record_model(family_equations(source), 1), take_phases, source.phase_breaks)
    loop = source
    of_phase = take_phases if loop.kept is None else loop.of_phase
    inputs = 1 if loop.kept is None else 1 + loop.states * loop.linearization.about.m
    return Kernel(record_model(state_equations(loop), inputs), of_phase, loop.phase_breaks)


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

    Raises: ArgumentError for an operation that the kernel does not know.
    """
    kinds = tuple(POINT if i == 1 else PHASE for i in range(function.n_in()))
    program, (states, rows) = Program.read(function).invert_once(kinds), function.size_out(0)
    program.check_known()
    code, needs, (Z, M, period) = program.steps[:, 0], program.find_needs(kinds), program.find_outputs()
    wanted = np.concatenate([Z, M, program.steps[(needs == PHASE | POINT) & (code != OUTPUT), 2:].ravel()])
    of_phase, of_point = (np.unique(wanted[np.isin(needs[wanted], kind)]) for kind in (PHASE, (POINT, 0)))
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
    return {k: starts[a] + b for code, k, a, b in program.steps.tolist() if code == INPUT and a in starts}
