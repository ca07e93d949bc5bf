"""CasADi functions that many points go through: their operations one after another, each on 32 points at once, in compiled code.

CasADi's own virtual machine carries out one operation on one point at a time, at some 4 ns; together they take about a tenth.
"""

import struct
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from flexlin._core import addresses, declare
from flexlin.checks import Array

TOGETHER = 32
"""Points that go through an operation together: W of tape.c."""
WORTH, FIXED = 200, 1e5
"""Points after which the time to read the operations is won back, and more for a few operations: FIXED by their number."""
LARGEST = 400_000
"""Operations of a function that is still read: CasADi writes some 90 bytes of each."""
CONST, INPUT, OUTPUT = ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT
UNARY = (0, 5, 6, 7, 10, 11, 12, 13, 14, 15, 16, 17, 18, 23, 26, 27, 29, 30, 36, 37, 38, 39, 40, 41, 42, 93, 94)
BINARY = (1, 2, 3, 4, 8, 9, 19, 20, 21, 22, 24, 25, 31, 32, 34, 35, 43, 95)
"""Operations that tape.c knows, by their numbers in CasADi."""
LOOKS = 24
"""Operations by which it is checked that they were read right."""


RUN = declare(
    "long run_tape(long steps, const Step *code, long points, const double *const *in, const long *rows, double *const *out, "
    "const long *sizes, double *work)",
    lambda steps, *_: ((steps, 4), None, None, None),
)
KEEP = declare(
    "long keep_outputs(long steps, const Step *code, const int *wanted, char *live, Step *kept)",
    lambda steps, *_: ((steps, 4), None, None, (steps, 4)),
)
SHARE = declare(
    "long share_steps(long steps, Step *code, long mask, int *found, int *value, int *last, int *place, int *empty, int *slots)",
    lambda steps, code, mask, *_: ((steps, 4), mask + 1, None, steps, steps, steps, 1),
)


@dataclass(frozen=True, eq=False)
class Tape:
    """The operations of a function: steps (K, 4) of int32, the sizes of inputs and outputs, and how many numbers are kept at a time."""

    steps: Array
    rows: Array
    sizes: Array
    slots: int

    @classmethod
    def of(cls, function: ca.Function) -> "Tape | None":
        """The tape of a function of dense inputs and outputs; None where it cannot be read, or holds an unknown operation."""
        if function.class_name() != "SXFunction" or not 0 < function.n_instructions() <= LARGEST:
            return None
        rows = np.array([function.numel_in(i) for i in range(function.n_in())], dtype=np.int64)
        sizes = np.array([function.numel_out(i) for i in range(function.n_out())], dtype=np.int64)
        steps, slots = read_steps(function), int(function.sz_w())
        if steps is None or not is_sound(steps, rows, sizes, slots):
            return None
        steps, slots = share_steps(steps, slots)
        return cls(steps, rows, sizes, slots)

    def keep(self, outputs: tuple[int, ...]) -> "Tape":
        """The tape of some of the outputs, without the operations that only the others need."""
        wanted, kept = np.zeros(len(self.sizes), dtype=np.int32), np.empty_like(self.steps)
        wanted[list(outputs)] = np.arange(1, len(outputs) + 1)
        left = KEEP(len(self.steps), self.steps, wanted, np.zeros(self.slots, dtype=np.int8), kept)
        return replace(self, steps=kept[:left].copy(), sizes=self.sizes[list(outputs)])

    def __call__(self, arrays: list[Array], outputs: list[Array]) -> None:
        """Fill the outputs, each (N, columns, rows), from the inputs, each (N, rows)."""
        read, written = addresses(arrays), addresses(outputs, written=True)
        work = np.empty(self.slots * TOGETHER)
        RUN(len(self.steps), self.steps, len(arrays[0]), read, self.rows, written, self.sizes, work)


@dataclass
class Usage:
    """How many points went through a function, and its tape once these are worth one."""

    function: ca.Function
    operations: int
    points: int = 0
    tape: Tape | None = None
    tried: bool = False

    def find_tape(self, points: int) -> Tape | None:
        """The tape, where the points so far and these are worth one and it can be made."""
        self.points += points
        if not self.tried and self.points > WORTH + FIXED / self.operations:
            self.tried, self.tape = True, Tape.of(self.function)
        return self.tape


@lru_cache(maxsize=64)
def usage_of(function: ca.Function) -> Usage:
    """The usage of a function, counted from its first call on; only SX functions list their operations."""
    return Usage(function, max(1, function.n_instructions()) if function.class_name() == "SXFunction" else 1)


def read_steps(function: ca.Function) -> Array | None:
    """The operations (K, 4): number, slot of the result, slots of the operands, or the eight bytes of a constant.

    CasADi hands out one operation a call; what it writes of a function to files holds them all in a row, a byte as two letters from a
    to p. They are found there by those that it does hand out.
    """
    count, text = function.n_instructions(), function.serialize()
    known = {k: letters(describe_step(function, k)) for k in sample_steps(count)}
    place = text.find(known[0])
    while place >= 0 and not all(text.startswith(word, place + 32 * k) for k, word in known.items()):
        place = text.find(known[0], place + 1)
    if place < 0 or len(text) < place + 32 * count:
        return None
    halves = np.frombuffer(text[place : place + 32 * count].encode("ascii"), dtype=np.uint8) - ord("a")
    return (halves[0::2] | halves[1::2] << 4).view("<i4").reshape(count, 4).astype(np.int32)


def share_steps(steps: Array, slots: int) -> tuple[Array, int]:
    """The same operations, each value computed once, and how many slots they need."""
    count, shared = len(steps), steps.copy()
    table = 2 ** (2 * count).bit_length()
    found, last = (np.full(size, -1, dtype=np.int32) for size in (table, count))
    value, place, empty = (np.empty(size, dtype=np.int32) for size in (slots, count, count))
    needed = np.empty(1, dtype=np.int32)
    left = SHARE(count, shared, table - 1, found, value, last, place, empty, needed)
    return shared[:left].copy(), int(needed[0])


def sample_steps(count: int) -> list[int]:
    """Some operations: the first ones, the last, and others between."""
    return sorted({*range(min(4, count)), *np.linspace(0, count - 1, LOOKS).astype(int).tolist()})


def describe_step(function: ca.Function, k: int) -> bytes:
    """One operation as CasADi writes it, as far as it says it."""
    op, to, of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
    if op == CONST:
        return struct.pack("<iid", op, to[0], function.instruction_constant(k))
    if op == OUTPUT:
        return struct.pack("<4i", op, to[0], of[0], to[1])
    return struct.pack(f"<{2 + len(of)}i", op, to[0], *of)


def letters(data: bytes) -> str:
    """Each byte as two letters, the lower half first."""
    return "".join(chr(97 + byte % 16) + chr(97 + byte // 16) for byte in data)


def is_sound(steps: Array, rows: Array, sizes: Array, slots: int) -> bool:
    """Whether every operation is known and stays within its slots; the second operand of those that have one is put out of the way."""
    op, to, a, b = steps.T
    single, double = np.isin(op, UNARY), np.isin(op, BINARY)
    const, given, result = op == CONST, op == INPUT, op == OUTPUT
    if not (single | double | const | given | result).all():
        return False
    b[single] = a[single]
    inside = [(to, ~result), (a, single | double | result), (b, double)]
    if not all(((column[which] >= 0) & (column[which] < slots)).all() for column, which in inside):
        return False
    return is_within(a[given], b[given], rows) and is_within(to[result], b[result], sizes)


def is_within(which: Array, place: Array, sizes: Array) -> bool:
    """Whether each place lies within the argument that it belongs to."""
    if not ((which >= 0) & (which < len(sizes))).all():
        return False
    return bool(((place >= 0) & (place < sizes[which])).all())
