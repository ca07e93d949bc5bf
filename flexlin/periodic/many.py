"""All Floquet exponents of x' = A(t, p) x at many values of p, several at a time: the kernel of sweeps and scans."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np

from flexlin._core import LANES, address, declare_sized
from flexlin.checks import Array
from flexlin.periodic.interpolation import NODES, divide_segments, place_edges
from flexlin.periodic.transition.gauss import gauss, place_nodes

WIDTH = LANES
"""Values in a vector at the most: results depend on which values are computed together, so blocks are cut at multiples of it."""
MULTIPLES = (2, 3, 4, 6, 8)
"""Resolutions, in multiples of a coarsest grid; three neighbouring ones give an answer."""
METHOD_ORDER = 4
"""Of the method. It is symmetric in time, so its error has the powers h^4, h^6, h^8 ..."""
DEGREE = 12
"""Of the polynomial of exponential.h."""
SIZES = [(2 * n, n) for n in range(1, 7)] + [(n, n) for n in range(2, 9)]
"""States and rows for which there is a kernel: second-order systems of 1 to 6 coordinates, first-order ones of 2 to 8 states."""
FIND_EXPONENTS = declare_sized(
    "int SIZED(find_exponents)(const void *model, const void *grids, long values, const double *points, double accuracy, double spread, "
    "double tol, double complex *logs, double *errors, char *sounds, double *periods, char *definite)",
    SIZES,
)
SAMPLE_MODEL = declare_sized(
    "int SIZED(sample_model)(const void *model, long values, const double *points, long nodes, const double *inputs, "
    "double *coefficients, char *sounds, double *periods)",
    SIZES,
)


@dataclass(frozen=True, eq=False)
class Model:
    """[I 0; 0 M] x' = [0 I; Z] x in units of the period, M (rows, rows), Z (rows, states) of phase and p; full where rows = states.

    Three programs of steps (K, 4) of int32, as program.h has them: `of_phase` and `of_point` find inputs in their first slots; `both` finds
    there what stands in the slots `from_point` and `from_phase` of the others. `outputs`: slots of Z, row by row, and of M where there
    is one; `period`: slot of T in the program of the point; `slots`: of all programs.
    """

    states: int
    rows: int
    of_phase: Array
    of_point: Array
    both: Array
    from_phase: Array
    from_point: Array
    outputs: Array
    phase_inputs: int
    parameters: int
    period: int
    slots: int

    @property
    def size(self) -> tuple[int, int]:
        """One of SIZES, or none for which there is a kernel."""
        return self.states, self.rows

    def describe(self) -> "CModel":
        """The same for the compiled code; it holds no array alive."""
        programs = self.of_phase, self.of_point, self.both
        places = [address(array) for array in (*programs, self.from_phase, self.from_point, self.outputs)]
        numbers = self.phase_inputs, self.parameters, len(self.from_phase), len(self.from_point)
        mass = len(self.outputs) > self.rows * self.states
        return CModel(*places, *map(len, programs), *numbers, mass, self.period, self.slots)


class CModel(ctypes.Structure):
    """`Model` of kernel.c."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("of_phase", "of_point", "both", "from_phase", "from_point", "outputs")),
        *((f"{name}_steps", ctypes.c_long) for name in ("phase", "point", "both")),
        *(
            (name, ctypes.c_int)
            for name in ("phase_inputs", "parameters", "phases", "points", "mass", "period", "slots")
        ),
    )


class CGrids(ctypes.Structure):
    """`Grids` of kernel.c."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("levels", "total")),
        *((name, ctypes.c_void_p) for name in ("segments", "lengths", "inputs", "gains", "scale")),
        ("reach", ctypes.c_double),
    )


@dataclass(frozen=True, eq=False)
class Logs:
    """Logs (V, n) of the multipliers, their errors (V, n), whether they are sound (V,), periods (V,) in s; whether M is definite (V,)."""

    logs: Array
    errors: Array
    sound: Array
    periods: Array
    definite: Array

    def misses(self, tol: float) -> Array:
        """The largest error of each value, in units of tol for exponents up to 1/s and relative beyond, (V,); infinite where unsound, not a
        number where M is not positive definite, and more segments do not help."""
        with np.errstate(invalid="ignore"):
            misses = np.max(self.errors / (tol * np.maximum(self.periods[:, None], np.abs(self.logs))), axis=1)
        return np.where(self.sound & np.isfinite(misses), misses, np.where(self.definite, np.inf, np.nan))


@dataclass(frozen=True, eq=False)
class Kernel:
    """A model and all that follows from it; `breaks`: phases in [0, 1).

    `of_phase`: phases (N,) -> (N, phase_inputs), the inputs of the phase's program.
    """

    model: Model
    of_phase: Callable[[Array], Array]
    breaks: tuple[float, ...] = ()

    def find_logs(
        self,
        points: Array,
        segments: int,
        scale: Array,
        accuracy: float,
        spread: float = np.inf,
        tol: float = 0.0,
        levels: int = len(MULTIPLES),
    ) -> Logs:
        """Logs of the multipliers at points (V, P), by an exponential of order 4 on 2, 3, 4 ... times `segments`, extrapolated to order 8.

        Parameters: scale (n,): of the states; accuracy: of the exponentials and eigenvalues, well below the error that is wanted;
        spread: of the logs of all moduli but the smallest, where it is known beforehand; tol: finer resolutions are left out where it is
        met, as of `sweep`; levels: resolutions at most.
        Raises: MemoryError.
        """
        V, n, points = len(points), self.model.states, np.ascontiguousarray(points, dtype=float)
        found = Logs(np.empty((V, n), complex), np.empty((V, n)), np.empty(V, bool), np.empty(V), np.empty(V, bool))
        counts, *tables = lay_grids(self, segments, levels)
        reach = (accuracy * factorial(DEGREE + 1)) ** (1 / DEGREE)
        tables += [np.ascontiguousarray(scale / scale[:, None])]
        grids, model = CGrids(levels, int(counts.sum()), *map(address, (counts, *tables)), reach), self.model.describe()
        results = found.logs, found.errors, found.sound.view(np.int8), found.periods, found.definite.view(np.int8)
        given = ctypes.byref(model), ctypes.byref(grids), V, points, accuracy, spread, tol
        if FIND_EXPONENTS[self.model.size](*given, *results):
            raise MemoryError("the factors of a period")
        return found

    def sample(self, points: Array, phases: Array) -> tuple[Array, Array, Array]:
        """M^-1 Z (V, N, rows, n) at points and phases, where the equations are sound (V,), and the periods (V,)."""
        points, inputs = np.ascontiguousarray(points, dtype=float), np.ascontiguousarray(self.of_phase(phases))
        V, N = len(points), len(phases)
        Z, sound, periods = np.empty((V, N, self.model.rows, self.model.states)), np.empty(V, dtype=bool), np.empty(V)
        model = self.model.describe()
        if SAMPLE_MODEL[self.model.size](ctypes.byref(model), V, points, N, inputs, Z, sound.view(np.int8), periods):
            raise MemoryError("the coefficients of a period")
        return Z, sound & np.isfinite(Z).all(axis=(1, 2, 3)), periods

    def balance(self, points: Array) -> Array:
        """A scaling (n,) of the states by powers of two that evens the mean of |A| over the period and points (V, P).

        Rates are scaled as their coordinates, but for one factor: so [0 I; Z] keeps its form up to a multiple of I.
        """
        from scipy.linalg import lapack  # SciPy, which workers do without

        Z, sound, _ = self.sample(points, np.arange(NODES) / NODES)
        n, rows = self.model.states, self.model.rows
        if not sound.any():
            return np.ones(n)
        A = np.eye(n, k=rows % n)
        A[n - rows :] = np.abs(Z[sound]).mean(axis=(0, 1))
        sizes = np.log2(lapack.dgebal(A, scale=1, permute=0)[3])
        if rows < n:
            places, rates = sizes.reshape(2, -1)
            factor = np.round(np.mean(rates - places))
            places = np.round((places + rates - factor) / 2)
            sizes = np.concatenate([places, places + factor])
        return np.asarray(2.0**sizes)


@lru_cache(maxsize=128)
def lay_grids(kernel: Kernel, segments: int, levels: int) -> list[Array]:
    """What of a computation the resolutions alone decide: segments, their lengths and nodes, gains; kept for the next one."""
    base = place_edges(1.0, kernel.breaks, segments)
    grids = [divide_segments(base, multiple) for multiple in MULTIPLES[:levels]]
    gains = [find_gains(*MULTIPLES[k - 2 : k + 1]) if k > 1 else np.zeros(4) for k in range(levels)]
    nodes = np.concatenate([place_nodes(grid, gauss(2).c).ravel() for grid in grids])
    return [
        np.array([len(grid) - 1 for grid in grids], dtype=np.intc),
        np.concatenate([np.diff(grid) for grid in grids]),
        np.ascontiguousarray(kernel.of_phase(nodes)),
        np.array(gains),
    ]


def take_phases(phases: Array) -> Array:
    """The inputs of a program of the phase alone, (N, 1)."""
    return phases[:, None]


def find_gains(coarse: int, middle: int, fine: int) -> Array:
    """What the steps a = middle - coarse and b = fine - middle add to the results, (4,), for numbers of segments.

        of order 6:  fine + gains[0] b,  and one resolution before  middle + gains[1] a
        of order 8:  fine + gains[2] b + gains[3] a

    The weights of the logs make the powers h^4 and h^6 vanish.
    """
    n = np.array([coarse, middle, fine]) / fine
    weights = np.linalg.solve([np.ones(3), n**-METHOD_ORDER, n ** -(METHOD_ORDER + 2)], [1.0, 0.0, 0.0])
    first, before = (1 / ((b / a) ** METHOD_ORDER - 1) for a, b in ((middle, fine), (coarse, middle)))
    return np.array([first, before, -(weights[0] + weights[1]), -weights[0]])


def measure_spread(logs: Array) -> float:
    """The widest spread of the logs (V, n) of the moduli, the smallest of each value left out; infinite where nothing is known."""
    sizes = np.sort(logs.real, axis=1)[:, min(1, logs.shape[1] - 1) :]
    return float(np.ptp(sizes, axis=1).max()) if sizes.size else np.inf
