"""The one checked door between CasADi and NumPy: many points, one mapped call; and the pickling of objects that hold expressions."""

from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from flexlin.checks import Array, real_array
from flexlin.context import holding
from flexlin.errors import ArgumentError, counted
from flexlin.lazy import lazy
from flexlin.program import Layout, Program

CHUNK_POINTS = 65536
"""Points in one mapped call at the most: bounds the memory of a call to CHUNK_POINTS * (numbers in + numbers out) * 8 bytes."""
FEW_POINTS = 3
"""Points below which CasADi's own way takes less time in any case."""
READING_POINTS, READING_COST = 500, 1e5
"""Points after which the time to read a function's instructions is won back, and more for a few of them: READING_COST by their number."""


def as_expression(name: str, value: object) -> ca.SX:
    """What is given as a CasADi expression; numbers and arrays are taken too.

    Raises: ArgumentError naming what was given instead.
    """
    try:
        return ca.SX(value)
    except (NotImplementedError, TypeError, ValueError, RuntimeError):
        expected = "a CasADi SX expression, or numbers"
        raise ArgumentError(f"{name} is of another kind", got=repr(value)[:80], expected=expected) from None


@lru_cache(maxsize=64)
def mapped(function: ca.Function, points: int) -> ca.Function:
    """Return `function` mapped over `points` points (kept: building the map costs more than a small call)."""
    return function.map(points)


@lru_cache(maxsize=64)
def selected(function: ca.Function, names: tuple[str, ...]) -> ca.Function:
    """The function with some of its outputs only, and without the work for the others (kept: a loop is asked at many values)."""
    inputs = function.sx_in()
    outputs = dict(zip(function.name_out(), function.call(inputs), strict=True))
    return ca.Function(function.name(), inputs, [outputs[name] for name in names], function.name_in(), list(names))


@dataclass(frozen=True)
class Part:
    """Some outputs of a function: its operations are read once for all parts, and CasADi makes one only where few points need it."""

    whole: ca.Function
    names: tuple[str, ...]

    @property
    def function(self) -> ca.Function:
        """The part as a function of its own."""
        return selected(self.whole, self.names)

    @property
    def places(self) -> tuple[int, ...]:
        """Where the outputs stand among those of the whole."""
        return tuple(map(self.whole.name_out().index, self.names))


def evaluate(function: ca.Function | Part, *arguments: Array) -> tuple[Array, ...]:
    """Evaluate a CasADi function, or a part of one, at N points at once.

    Assumes dense inputs and outputs, each input a column vector.

    Parameters: arguments: one array (N, rows) for each input of the function.
    Returns: one array (N, rows, columns) for each output.
    Raises: ArgumentError when the number of inputs or a shape does not fit (nothing is broadcast), or a number is not finite.
    """
    arrays = checked_inputs(function.whole if isinstance(function, Part) else function, arguments)
    points = len(arrays[0])
    chunks = [call(function, [a[i : i + CHUNK_POINTS] for a in arrays]) for i in range(0, points, CHUNK_POINTS)]
    if len(chunks) == 1:
        return tuple(chunks[0])
    return tuple(np.concatenate(parts) for parts in zip(*chunks, strict=True))


def checked_inputs(function: ca.Function, arguments: tuple[Array, ...]) -> list[Array]:
    """Check that each argument is finite and fits its input."""
    inputs = usage_of(function).layout[0]
    if len(arguments) != len(inputs):
        raise ArgumentError(f"{function.name()} takes {counted(len(inputs), 'input')}", got=len(arguments))
    arrays = [
        np.ascontiguousarray(real_array(name, a, (None, size)))
        for (name, size), a in zip(inputs, arguments, strict=True)
    ]
    lengths = {len(a) for a in arrays}
    if len(lengths) != 1 or 0 in lengths:
        raise ArgumentError("inputs of unequal or zero length", got=sorted(lengths), expected="the same N > 0 for all")
    return arrays


@dataclass
class Usage:
    """A function's layout, asked of CasADi once; how many points went through it; its program once these are worth one."""

    function: ca.Function
    operations: int
    points: int = 0
    program: Program | None = None
    tried: bool = False

    @lazy
    def layout(self) -> tuple[tuple[tuple[str, int], ...], tuple[tuple[int, int], ...]]:
        """Name and size of each input, columns and rows of each output. Raises: ArgumentError where an output is sparse."""
        f = self.function
        for i in range(f.n_out()):
            if f.nnz_out(i) != f.numel_out(i):
                got = f"output {f.name_out(i)} of {f.name()} is sparse"
                raise ArgumentError(got, expected="a dense output (casadi.densify)")
        inputs = tuple((f.name_in(i), f.numel_in(i)) for i in range(f.n_in()))
        return inputs, tuple((f.size2_out(i), f.size1_out(i)) for i in range(f.n_out()))

    def find_program(self, points: int) -> Program | None:
        """The program, where the points so far and these are worth one, and the compiled core knows all of its operations."""
        self.points += points
        if not self.tried and (AT_ONCE.get() or self.points > READING_POINTS + READING_COST / self.operations):
            # what is none of scalars, calls another, or has a rare operation is left to CasADi
            with suppress(ArgumentError):
                program = Program.read(self.function)
                program.check_known()
                self.program = program
            self.tried = True  # only now: another thread may ask meanwhile
        return self.program


AT_ONCE = ContextVar("functions become programs at once", default=False)


def reading_at_once() -> AbstractContextManager[None]:
    """Within it results do not depend, in their last bits, on how many points went through a function before."""
    return holding(AT_ONCE, True)


@lru_cache(maxsize=64)
def usage_of(function: ca.Function) -> Usage:
    """The usage of a function, counted from its first call on; only functions of expressions list their operations."""
    return Usage(function, max(1, function.n_instructions()) if function.class_name() == "SXFunction" else 1)


@lru_cache(maxsize=64)
def lay_out(program: Program, outputs: tuple[int, ...] | None) -> Layout:
    """The layout for some outputs (kept: a loop is asked at many values)."""
    return program.lay_out(outputs)


def call(function: ca.Function | Part, arrays: list[Array]) -> list[Array]:
    """Run one mapped call; column-major memory is (N, columns, rows) here. A function that many points go through becomes a program.

    Of a part few points go through the whole before that, since making the part takes longer.
    """
    points = len(arrays[0])
    whole, places = (function.whole, function.places) if isinstance(function, Part) else (function, None)
    usage = usage_of(whole)
    program = usage.find_program(points)
    if program is not None and (points >= FEW_POINTS or places is not None):
        shapes = usage.layout[1] if places is None else [usage.layout[1][i] for i in places]
        chosen = [np.empty((points, *shape)) for shape in shapes]
        lay_out(program, places)(arrays, chosen)
        return [output.transpose(0, 2, 1) for output in chosen]
    if isinstance(function, Part) and usage.tried:
        return call_casadi(function.function, arrays)
    found = call_casadi(whole, arrays)
    return found if places is None else [found[i] for i in places]


def empty_outputs(function: ca.Function, points: int) -> list[Array]:
    """Room for the outputs at so many points, each (N, columns, rows)."""
    return [np.empty((points, *shape)) for shape in usage_of(function).layout[1]]


def call_casadi(function: ca.Function, arrays: list[Array]) -> list[Array]:
    """Run one mapped call through CasADi's buffers."""
    points = len(arrays[0])
    buffer: Any
    buffer, trigger = mapped(function, points).buffer()
    for i, array in enumerate(arrays):
        if array.size:
            buffer.set_arg(i, array.data)
    outputs = empty_outputs(function, points)
    for i, output in enumerate(outputs):
        buffer.set_res(i, output.data)
    trigger()
    return [output.transpose(0, 2, 1) for output in outputs]


def call_at(function: ca.Function, *arguments: Array) -> list[Array]:
    """The outputs (rows, columns) at one point, each argument a vector.

    The numbers are not checked to be finite: an integrator's trial step may leave the range, and says so itself.
    """
    return [made[0] for made in call_casadi(function, [np.array(one, dtype=float)[None] for one in arguments])]


class Expressions:
    """A frozen dataclass whose fields hold CasADi expressions, alone or inside other such objects and tuples.

    What is derived from the fields and kept beside them is not pickled; it is derived again. Symbols are shared inside one object: two
    objects that are pickled side by side each have symbols of their own afterwards.
    """

    def __getstate__(self) -> dict[str, Any]:
        serializer = ca.StringSerializer()
        state = flattened({f.name: getattr(self, f.name) for f in fields(self)}, serializer)  # type: ignore[arg-type]
        return {"expressions": serializer.encode(), "fields": state}

    def __setstate__(self, state: dict[str, Any]) -> None:
        rebuild(self, restored(state["fields"], ca.StringDeserializer(state["expressions"])))


class Expression:
    """Stands for the next expression of the serialisation."""


class Held:
    """Stands for another object with expressions: its class and its fields."""

    def __init__(self, kind: type, state: Any):
        self.kind, self.state = kind, state


def flattened(value: Any, serializer: "ca.StringSerializer | Row") -> Any:
    """The value with its expressions moved into the serialisation, in the order in which they are met."""
    if isinstance(value, ca.SX):
        serializer.pack(value)
        return Expression()
    if isinstance(value, Expressions):
        state = {f.name: getattr(value, f.name) for f in fields(value)}  # type: ignore[arg-type]
        return Held(type(value), flattened(state, serializer))
    return each_inside(value, lambda item: flattened(item, serializer))


def restored(value: Any, expressions: "ca.StringDeserializer | Row") -> Any:
    """The value with its expressions back in place."""
    if isinstance(value, Expression):
        return expressions.unpack()
    if isinstance(value, Held):
        made: Any = object.__new__(value.kind)
        rebuild(made, restored(value.state, expressions))
        return made
    return each_inside(value, lambda item: restored(item, expressions))


def each_inside(value: Any, change: Callable[[Any], Any]) -> Any:
    """A dictionary or a tuple with each of its items changed; anything else as it is."""
    if isinstance(value, dict):
        return {key: change(item) for key, item in value.items()}
    return tuple(map(change, value)) if type(value) is tuple else value


class Row(deque[Any]):
    """Expressions one after the other, in the place of a serialisation."""

    pack, unpack = deque.append, deque.popleft


def substituted(made: Any, old: ca.SX, new: ca.SX) -> Any:
    """The same object with other expressions in the place of symbols, in all that it holds."""
    row = Row()
    state = flattened(made, row)
    return restored(state, Row(ca.substitute(list(row), [old], [new])))


def rebuild(made: Any, state: dict[str, Any]) -> None:
    """Set the fields of a frozen object."""
    for name, item in state.items():
        object.__setattr__(made, name, item)
