"""A CasADi function read once, through CasADi's own instruction interface, as a list of scalar operations: data, not code.

What reads it: the compiled core, which carries out each operation on 32 points at once (CasADi's virtual machine does it at one point at a
time, at some 4 ns; here it takes a tenth); the kernel for charts, which parts it by what its values depend on; Taylor series, which
carry out the operations on power series.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from typing import Self, TypeVar

import casadi as ca
import numpy as np

from flexlin._core import addresses, declare
from flexlin.checks import Array
from flexlin.errors import ArgumentError

WORDS = 4
"""Whole numbers of a step: Step of program.h."""
POINTS_TOGETHER = 32
"""Points that go through an operation together: WIDE of program.h."""
CONST, INPUT, OUTPUT = ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT
T = TypeVar("T")

number_values = declare(
    "long number_values(long steps, Step *code, long mask, int *found, int *value)",
    lambda steps, code, mask, *_: ((steps, WORDS), mask + 1, None),
)
find_needs = declare(
    "void find_needs(long steps, const Step *code, const int *kinds, int *needs)",
    lambda steps, *_: ((steps, WORDS), None, steps),
)
lay_out = declare(
    "long lay_out(long steps, const Step *code, const int *wanted, char *live, int *slot, int first, int *last, int *empty, "
    "Step *placed, int *slots)",
    lambda steps, *_: ((steps, WORDS), None, steps, steps, steps, steps, (steps, WORDS), 1),
)
march_program = declare(
    "long march_program(long steps, const Step *code, long points, long times, long inputs, const double **in, const long *rows, "
    "const long *ahead, long outputs, double **out, const long *sizes, const long *beyond, double *work)",
    lambda steps, code, points, times, m, read, rows, ahead, n, *_: ((steps, WORDS), m, m, n, n, None),
)


@dataclass(frozen=True, eq=False)
class Program:
    """The operations of a function in an order in which they can be done; each value is computed once and numbered by its step.

    Parameters: steps (K, 4) of int32: CasADi's number of the operation; the step's own number; the numbers of its operands, twice the
    same where there is one. A constant has its eight bytes in place of operands, an input its argument and its place there; an output,
    which is no value, has its own number in place of the step's, then the value, and its place. rows, sizes: numbers of inputs and outputs.
    CasADi keeps its numbers of operations from release to release: the functions that it writes to files hold them.
    """

    steps: Array
    rows: Array
    sizes: Array

    @classmethod
    def read(cls, function: ca.Function) -> Self:
        """Read a function of scalar operations (SX). Raises: ArgumentError where it is none, calls another, or has free symbols."""
        if function.class_name() != "SXFunction":
            raise ArgumentError("the function is none of scalar operations", got=function.class_name(), expected="SX")
        if function.has_free():
            raise ArgumentError("an expression has free symbols", got=function.get_free(), expected="variables alone")
        every = range(function.n_instructions())
        steps = np.zeros((len(every), WORDS), dtype=np.int32)
        steps[:, 0] = np.fromiter(map(function.instruction_id, every), np.int32)
        if ca.OP_CALL in steps[:, 0]:
            raise ArgumentError("the function calls another one", got=function.name(), expected="one written out")
        sources, targets = (
            np.fromiter(
                chain.from_iterable((found[0], found[-1]) if found else (0, 0) for found in map(ask, every)), np.int32
            )
            for ask in (function.instruction_input, function.instruction_output)
        )  # lists of so many lists would be looked through by Python's collector of garbage, again and again
        results = np.flatnonzero(steps[:, 0] == OUTPUT)
        steps[:, 1], steps[:, 2:] = targets[::2], sources.reshape(-1, 2)
        steps[results, 3] = targets[2 * results + 1]
        numbers = np.flatnonzero(steps[:, 0] == CONST)
        constants = np.array([function.instruction_constant(k) for k in numbers.tolist()], dtype=float)
        steps[numbers, 2:] = constants.view(np.int32).reshape(-1, 2)  # the eight bytes of each
        rows = np.array([function.nnz_in(i) for i in range(function.n_in())], dtype=np.int64)
        sizes = np.array([function.nnz_out(i) for i in range(function.n_out())], dtype=np.int64)
        return cls(share_values(steps, function.sz_w()), rows, sizes)

    @property
    def numbers(self) -> Array:
        """The numbers of constants, (K,); elsewhere without meaning."""
        return self.steps[:, 2:].copy().view(float)[:, 0]

    def carry_out(
        self, inputs: list[list[T]], constant: Callable[[float], T], apply: Callable[[int, T, T], T]
    ) -> list[list[T]]:
        """The outputs over any kind of numbers, such as power series or the expressions of another program.

        Parameters: inputs: the numbers of each input; constant: makes one of a float; apply: carries out CasADi's operation of this number
        on two operands, twice the same where it has one.
        """
        values, outputs, ends = dict[int, T](), [dict[int, T]() for _ in self.sizes], self.find_ends()
        for i, ((code, k, a, b), number) in enumerate(zip(self.steps.tolist(), self.numbers.tolist(), strict=True)):
            if code == CONST:
                values[k] = constant(number)
            elif code == INPUT:
                values[k] = inputs[a][b]
            elif code == OUTPUT:
                outputs[k][b] = values[a]
            else:
                values[k] = apply(code, values[a], values[b])
            for value in ends[i]:
                del values[value]
        return [[made[place] for place in range(size)] for made, size in zip(outputs, self.sizes, strict=True)]

    def find_ends(self) -> list[list[int]]:
        """The values that each step is the last to read."""
        last, ends = dict[int, int](), [list[int]() for _ in self.steps]
        for i, (code, _, a, b) in enumerate(self.steps.tolist()):
            if code not in (CONST, INPUT):
                last |= {a: i} if code == OUTPUT else {a: i, b: i}
        for value, i in last.items():
            ends[i].append(value)
        return ends

    def find_outputs(self) -> list[Array]:
        """The values of each output, by their places; -1 where an output has none."""
        found = [np.full(size, -1) for size in self.sizes]
        for which, values in enumerate(found):
            mine = self.steps[(self.steps[:, 0] == OUTPUT) & (self.steps[:, 1] == which)]
            values[mine[:, 3]] = mine[:, 2]
        return found

    def check_known(self) -> None:
        """Raises: ArgumentError for an operation that the core does not know."""
        self.lay_out()([np.zeros((1, size)) for size in self.rows], [np.empty((1, size)) for size in self.sizes])

    def find_needs(self, kinds: tuple[int, ...]) -> Array:
        """What each step depends on, (K,): the kinds (sets of bits) of the inputs behind it, joined."""
        needs = np.empty(len(self.steps), dtype=np.int32)
        find_needs(len(self.steps), self.steps, np.array(kinds, dtype=np.int32), needs)
        return needs

    def lay_out(
        self,
        outputs: tuple[int, ...] | None = None,
        kept: Array | tuple[int, ...] = (),
        given: dict[int, int] | None = None,
        first: int = 0,
    ) -> "Layout":
        """The steps that lead to some outputs (all by default) and to the values `kept`, in slots of memory.

        Parameters: given: values that stand in a slot already; first: the first slot that may be used.
        """
        count = len(self.steps)
        wanted, live = np.zeros(len(self.sizes) + 1, dtype=np.int32), np.zeros(count, dtype=np.int8)
        chosen = list(range(len(self.sizes))) if outputs is None else list(outputs)
        wanted[chosen] = np.arange(1, len(chosen) + 1)
        live[np.asarray(kept, dtype=int)] = 1
        slot, last = (np.full(count, -1, dtype=np.int32) for _ in range(2))
        for value, place in (given or {}).items():
            slot[value] = place
        empty, needed, placed = np.empty(count, dtype=np.int32), np.empty(1, dtype=np.int32), np.empty_like(self.steps)
        left = lay_out(count, self.steps, wanted, live, slot, first, last, empty, placed, needed)
        return Layout(placed[:left].copy(), slot, int(needed[0]), self.rows, self.sizes[chosen])


@dataclass(frozen=True, eq=False)
class Layout:
    """Steps whose values stand in slots; `places`: the slot of each value of the program, -1 where it is not computed."""

    steps: Array
    places: Array
    slots: int
    rows: Array
    sizes: Array

    def __call__(self, arrays: list[Array], outputs: list[Array]) -> None:
        """Fill the outputs, each (N, size), from the inputs, each (N, rows). Raises: as `march`."""
        self.march(1, arrays, self.rows, outputs, self.sizes)

    def march(self, times: int, arrays: list[Array], ahead: Array, outputs: list[Array], beyond: Array) -> None:
        """Do so several times, with inputs and outputs so many numbers further on each time.

        Raises: ArgumentError for an operation that the core does not know.
        """
        read, written = addresses(arrays), addresses(outputs, written=True)
        work = np.empty(max(1, self.slots) * POINTS_TOGETHER)
        points = len(arrays[0]) if arrays else len(outputs[0])
        given = len(arrays), read, self.rows, ahead, len(outputs), written, self.sizes, beyond
        unknown = march_program(len(self.steps), self.steps, points, times, *given, work)
        if unknown:
            raise ArgumentError(
                "an operation of the expressions is not known here", got=name_of(int(self.steps[unknown - 1, 0]))
            )


def share_values(steps: Array, slots: int) -> Array:
    """Steps with slots as steps with numbers of values, each value computed once."""
    count, shared = len(steps), steps.copy()
    table = 2 ** (2 * count).bit_length()
    found, value = np.full(table, -1, dtype=np.int32), np.zeros(max(1, slots), dtype=np.int32)
    return shared[: number_values(count, shared, table - 1, found, value)].copy()


def name_of(operation: int) -> str:
    """CasADi's name of an operation."""
    return next((name for name in dir(ca) if name.startswith("OP_") and getattr(ca, name) == operation), str(operation))
