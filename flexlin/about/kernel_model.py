"""The coefficients of a parametric system as data for the kernel, parted into what the phase, the parameters, or both decide."""

from collections.abc import Iterable

import casadi as ca
import numpy as np

from flexlin.about.family import PeriodicFamily
from flexlin.about.free import ParametricLoop
from flexlin.about.instructions import Needs, Program, read_program
from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.periodic.many.kernel import Kernel, Model, take_phases

KNOWN = {*range(44), ca.OP_CONST, ca.OP_LOG1P, ca.OP_EXPM1, ca.OP_HYPOT, ca.OP_REMAINDER}
"""Operations of program.c, by their numbers in CasADi."""


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
    program, (states, rows) = read_program(function, point=1), function.size_out(0)
    unknown = {one.code for one in program.instructions} - KNOWN - {ca.OP_INPUT}
    if unknown:
        raise ArgumentError(
            "an operation of the expressions is not known to the kernel", got=f"CasADi operations {sorted(unknown)}"
        )
    needs = [one.needs for one in program.instructions]
    outputs, period = program.outputs[0] + program.outputs[1], program.outputs[2][0]
    mixed = [i for i, one in enumerate(needs) if one == Needs.BOTH]
    wanted = {i for k in mixed for i in program.instructions[k].arguments} | set(outputs)
    of_phase, of_point = (
        [i for i in sorted(wanted) if needs[i] in kinds] for kinds in ((Needs.PHASE,), (Needs.POINT, Needs.NUMBER))
    )
    phase_part, phase_slots, phase_size = place(program, Needs.PHASE, phase_inputs, {}, of_phase)
    point_part, point_slots, point_size = place(program, Needs.POINT, function.numel_in(1), {}, [*of_point, period])
    given = {i: k for k, i in enumerate([*of_point, *of_phase])}
    both, slots, size = place(program, Needs.BOTH, len(given), given, outputs)
    return Model(
        states,
        rows,
        *(phase_part, point_part, both),
        *(as_slots(phase_slots, of_phase), as_slots(point_slots, of_point), as_slots(slots, outputs)),
        phase_inputs,
        function.numel_in(1),
        point_slots[period],
        max(phase_size, point_size, size, 1),
    )


def as_slots(slots: dict[int, int], values: Iterable[int]) -> Array:
    """Where values stand."""
    return np.array([slots[i] for i in values], dtype=np.int32)


def place(
    program: Program, kind: Needs, first: int, given: dict[int, int], kept: list[int]
) -> tuple[Array, dict[int, int], int]:
    """The steps (K, 4) of one kind that lead to the values `kept`, where each value stands, and how many slots they need.

    Slots below `first` hold inputs, or the values `given` there; one that nobody reads any more is used again.
    """
    instructions, wanted, order = program.instructions, set(kept), []
    for i in reversed(range(len(instructions))):
        one = instructions[i]
        if i in wanted and i not in given and one.needs in (kind, Needs.NUMBER):
            order.append(i)
            wanted.update(one.arguments)
    order.reverse()
    last = {a: i for i in order for a in instructions[i].arguments}
    slots, free, size, steps = dict(given), [], first, []
    for i in order:
        one = instructions[i]
        if one.code == ca.OP_INPUT:
            slots[i] = one.place
            continue
        operands = [slots[a] for a in one.arguments]
        free += [slots[a] for a in set(one.arguments) if last[a] == i and a not in kept and slots[a] >= first]
        slots[i] = free.pop() if free else size
        size = max(size, slots[i] + 1)
        if one.code == ca.OP_CONST:
            operands = np.array([one.number]).view(np.int32).tolist()
        steps.append([one.code, slots[i], operands[0], operands[-1]])
    return np.array(steps, dtype=np.int32).reshape(-1, 4), slots, size
