"""The kernel of `romberg` and `spectrum` in C: eight values at a time, from coefficients to exponents with their errors."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from math import factorial

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import load_library, pointer
from flexlin.lazy import lazy
from flexlin.periodic.grid import divide_segments, place_edges
from flexlin.periodic.many.extrapolation import MULTIPLES, find_gains
from flexlin.periodic.transition.gauss import gauss, place_nodes

WIDTH = 8
"""Values in a vector: results depend on which eight values are computed together, so blocks are cut at multiples of it."""
DEGREES = (12, 18)
REGISTERS = 20
"""Vectors that a block of a product may keep in registers."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Exponents (V, n) by falling real part in 1/s, the largest error of each value, verdict codes, periods, and errors over tol."""

    exponents: Array
    error: Array
    verdict: Array
    period: Array
    misses: Array


@dataclass(frozen=True, eq=False)
class CompiledKernel:
    """One loop's coefficients and all that follows from them, in C.

    `model`: C source of the coefficients; `coordinates`: n of y (n,); `of_phase`: phases (N,) -> (N, k), what of the phase the
    coefficients are made of; `breaks`: phases in [0, 1); `memory`: ignorable ones among the coordinates, as of `batched_exponents`. Pickled
    without its library, which is compiled or found again.
    """

    model: str
    coordinates: int
    of_phase: Callable[[Array], Array]
    breaks: tuple[float, ...] = ()
    memory: int = 0

    @property
    def states(self) -> int:
        """The number of states: coordinates that are not ignorable, and all rates."""
        return 2 * self.coordinates - self.memory

    @lazy
    def library(self) -> ctypes.CDLL:
        """The compiled code. Raises: NumericalError where it cannot be compiled."""
        return load_library(self.source)

    @property
    def source(self) -> str:
        """The whole C source."""
        rows, columns = choose_block(self.coordinates)
        text = [
            files("flexlin.periodic.many").joinpath(name).read_text(encoding="utf-8")
            for name in ("vectors.c", "exponential.c", "eigenvalues.c", "product.c", "kernel.c")
        ]
        states, panel = 2 * self.coordinates, columns if self.coordinates < 3 else self.coordinates
        sizes = {
            "S": states,
            "MEMORY": self.memory,
            "STATES": self.states,
            "ROWS": rows,
            "COLUMNS": columns,
            "PANEL": panel,
        }
        return "\n".join([text[0], *[f"#define {name} {size}" for name, size in sizes.items()], self.model, *text[1:]])

    def find_logs(
        self,
        points: Array,
        segments: int,
        scale: Array,
        accuracy: float,
        spread: float,
        tol: float = 0.0,
        levels: int = len(MULTIPLES),
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Logs (V, n) of the multipliers, their errors (V, n), whether they are sound (V,), the periods (V,) in s, and segments computed.

        Parameters: points (V, P); segments, accuracy, spread: as of `batched_exponents`; scale (2 n,): of coordinates and rates; tol: finer
        resolutions, to four times as fine as `batched_exponents`, are left out where it is met, as of `sweep`; levels: resolutions at most.
        Raises: MemoryError.
        """
        V, states = len(points), self.states
        given = [
            *self.tabulate(segments, levels),
            np.ascontiguousarray(scale / scale[:, None]),
            np.array([(accuracy * factorial(degree + 1)) ** (1 / degree) for degree in DEGREES]),
        ]
        points = np.ascontiguousarray(points, dtype=float)
        logs, errors = np.empty((V, states), dtype=complex), np.empty((V, states))
        sound, periods, work = np.empty(V, dtype=bool), np.empty(V), np.empty(V, dtype=np.intc)
        numbers = ctypes.c_double(accuracy), ctypes.c_double(spread), ctypes.c_double(tol)
        results = [pointer(array) for array in (logs, errors, sound, periods, work)]
        start = ctypes.c_long(V), pointer(points), ctypes.c_int(levels)
        if self.library.find_exponents(*start, *map(pointer, given), *numbers, *results):
            raise MemoryError("the factors of a period")
        return logs, errors, sound, periods, work

    def tabulate(self, segments: int, levels: int) -> list[Array]:
        """What of a computation the resolutions alone decide: segments, their lengths and nodes, gains; kept for the next one."""
        key = segments, levels
        if key not in self.tables:
            base = place_edges(1.0, self.breaks, segments)
            grids = [divide_segments(base, multiple) for multiple in MULTIPLES[:levels]]
            gains = [find_gains(*MULTIPLES[k - 2 : k + 1]) if k > 1 else np.zeros(4) for k in range(levels)]
            nodes = np.concatenate([place_nodes(grid, gauss(2).c).ravel() for grid in grids])
            self.tables[key] = [
                np.array([len(grid) - 1 for grid in grids], dtype=np.intc),
                np.concatenate([np.diff(grid) for grid in grids]),
                np.ascontiguousarray(self.of_phase(nodes)),
                np.array(gains),
            ]
        return self.tables[key]

    @lazy
    def tables(self) -> dict[tuple[int, int], list[Array]]:
        """Of `tabulate`."""
        return {}

    def judge(self, logs: Array, errors: Array, sound: Array, periods: Array, tol: float) -> Judged:
        """Exponents and verdicts of logs, in whose place they are written; tol as of `sweep`."""
        error, verdict, misses = np.empty(len(logs)), np.empty(len(logs), dtype=np.int8), np.empty(len(logs))
        arrays = [pointer(array) for array in (periods, sound, logs, errors, error, verdict, misses)]
        self.library.judge(ctypes.c_long(len(logs)), ctypes.c_double(tol), *arrays)
        return Judged(logs, error, verdict, periods, misses)

    def __getstate__(self) -> dict[str, object]:
        return {name: getattr(self, name) for name in ("model", "coordinates", "of_phase", "breaks", "memory")}


def choose_block(coordinates: int) -> tuple[int, int]:
    """Rows and columns of the blocks of a product with n or 2n rows, 2n columns: those that load least for each multiplication."""
    rows, columns = ([k for k in range(1, n + 1) if n % k == 0] for n in (coordinates, 2 * coordinates))
    blocks = [(r, c) for r in rows for c in columns if r * c <= REGISTERS]
    return min(blocks, key=lambda block: ((block[0] + block[1]) / (block[0] * block[1]), block[0]))
