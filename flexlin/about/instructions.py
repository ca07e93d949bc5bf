"""The instructions of a CasADi function as a list in which each value is computed once, each with what it depends on."""

from dataclasses import dataclass, field
from enum import IntFlag
from typing import Any

import casadi as ca


class Needs(IntFlag):
    """What a value depends on: a number, the phase alone, the point alone, or both."""

    NUMBER = 0
    PHASE = 1
    POINT = 2
    BOTH = 3


@dataclass(frozen=True)
class Instruction:
    """value = code(arguments); a number has its value, an input its place among the phase's or the point's numbers."""

    code: int
    arguments: tuple[int, ...]
    needs: Needs
    number: float = 0.0
    place: int = 0


@dataclass
class Program:
    """Instructions in an order in which they can be done; `outputs[i]` numbers the values of output i."""

    instructions: list[Instruction] = field(default_factory=list)
    outputs: list[list[int]] = field(default_factory=list)
    known: dict[Any, int] = field(default_factory=dict)

    def add(
        self,
        code: int,
        arguments: tuple[int, ...] = (),
        needs: Needs = Needs.NUMBER,
        number: float = 0.0,
        place: int = 0,
    ) -> int:
        """The number of a value; an instruction that is there already is not repeated."""
        if code in COMMUTATIVE:
            arguments = tuple(sorted(arguments))
        key = (code, arguments, needs if code == ca.OP_INPUT else None, str(number), place)
        if key not in self.known:
            self.known[key] = len(self.instructions)
            self.instructions.append(Instruction(code, arguments, needs, number, place))
        return self.known[key]

    def apply(self, code: int, arguments: tuple[int, ...]) -> int:
        """An operation; a quotient of what depends on both by what depends on one becomes a product, its reciprocal taken once."""
        needs = Needs.NUMBER
        for i in arguments:
            needs |= self.instructions[i].needs
        below = self.instructions[arguments[-1]].needs
        if code == ca.OP_DIV and needs == Needs.BOTH and below != Needs.BOTH:
            inverse = self.add(ca.OP_INV, arguments[1:], below or Needs.PHASE)
            return self.add(ca.OP_MUL, (arguments[0], inverse), needs)
        return self.add(code, arguments, needs or Needs.PHASE)


COMMUTATIVE = (ca.OP_ADD, ca.OP_MUL)


def read_program(function: ca.Function, point: int) -> Program:
    """Read a function of scalar operations whose input number `point` is the point; all others belong to the phase, in their order."""
    program, work = Program(), dict[int, int]()
    starts = [sum(function.nnz_in(j) for j in range(i) if j != point) for i in range(function.n_in())]
    program.outputs = [[-1] * function.nnz_out(i) for i in range(function.n_out())]
    for k in range(function.n_instructions()):
        code, source, target = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_CONST:
            work[target[0]] = program.add(code, number=function.instruction_constant(k))
        elif code == ca.OP_INPUT:
            at_point = source[0] == point
            place = source[1] + (0 if at_point else starts[source[0]])
            work[target[0]] = program.add(code, needs=Needs.POINT if at_point else Needs.PHASE, place=place)
        elif code == ca.OP_OUTPUT:
            program.outputs[target[0]][target[1]] = work[source[0]]
        else:
            work[target[0]] = program.apply(code, tuple(work[i] for i in source))
    return program
