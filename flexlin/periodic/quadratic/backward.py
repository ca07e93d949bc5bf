"""Compiled solutions of the Riccati equation over the four parts of a period: the calls of the C files beside this one."""

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address, find_kept_library
from flexlin.periodic.quadratic.samples import PARTS, RiccatiSamples

FILES = tuple(
    Path(__file__).with_name(f"{name}.c") for name in ("sweeps", "spectrum", "coarse", "correction", "running_cost")
)
SEEN = 32
"""Times at which the sizes of X and of the gain are looked at."""


@lru_cache(maxsize=1)
def find_sweeps() -> ctypes.CDLL | None:
    """The library of these files; none where there is no compiler."""
    library = find_kept_library(*FILES)
    if library is not None:
        whole, long, real, where = ctypes.c_int, ctypes.c_long, ctypes.c_double, ctypes.c_void_p
        ports: list[Any] = [where, long] * 3
        library.correct_until_closed.argtypes = [where, real, real, real, whole, where, real, where, where, where]
        library.evaluate_residual.argtypes = [where, real, whole, *[where] * 4]
        library.solve_lyapunov.argtypes = [where, real, real, where, whole, where, where]
        library.compare_with_equation.argtypes = [where, long, real, whole, where, real, long, whole, *ports, where]
        library.bound_gain.argtypes = [where, long, long, long, whole, *ports, where, where]
        library.weigh_inputs.argtypes = [whole, whole, whole, long, *ports[:4], where]
        library.find_rate.argtypes = [where]
        library.compare_with_equation.restype = library.find_rate.restype = real
    return library


@dataclass(frozen=True, eq=False)
class Swept:
    """A periodic solution on N nodes: values (N / 4, n (n + 1) / 2, 4) at the nodes of four parts.

    series (2 H + 1, n (n + 1) / 2): of its lower triangle, through every so many nodes; empty where none is asked for.
    """

    values: Array
    series: Array
    every: int


def correct_until_closed(
    library: ctypes.CDLL,
    samples: RiccatiSamples,
    period: float,
    rate: float,
    near: float,
    start: Array | None = None,
    tol: float = 0.0,
) -> Swept | None:
    """Find X by Newton's method on its series, whose steps are solved by exponentials of the loop and correct each other.

    Parameters: rate: the Hamiltonian's spectral radius; near: the change of X, relative to X, after which it ends; start: a series that
    is close to the solution; none: zero; tol: of the series: waves below this part of the mean need not be seen.
    Returns: None where the steps do not settle.
    """
    entries, nodes = samples.n * (samples.n + 1) // 2, samples.count // (2 * PARTS)
    X, series, shape = np.empty((nodes, entries, PARTS)), np.empty((8 * nodes // 3 + 1, entries)), np.zeros(2, np.int64)
    begin = (0, None) if start is None else (len(start) // 2, address(start))
    out = (tol, address(X), address(series), address(shape))
    if not library.correct_until_closed(samples.place, period, rate, near, *begin, *out):
        return None
    return Swept(X, series[: 2 * shape[0] + 1], int(shape[1]))


def evaluate_residual(library: ctypes.CDLL, samples: RiccatiSamples, period: float, series: Array) -> Array:
    """Return X, X' and X' + A' X + X A - X S X + Q of a series at every second sample: (3, N / 8, n (n + 1) / 2, 4)."""
    found = np.empty((3, samples.count // (2 * PARTS), series.shape[1], PARTS))
    if not library.evaluate_residual(samples.place, period, len(series) // 2, address(series), *map(address, found)):
        raise MemoryError
    return found


def solve_loop_lyapunov(
    library: ctypes.CDLL, samples: RiccatiSamples, period: float, near: float, X: Array, right: Array
) -> Array | None:
    """Solve -D' = Ac' D + D Ac + F for several F, Ac the loop of X; all of shape (., N / 8, n (n + 1) / 2, 4), at every second sample.

    near: change of D, relative to itself. Returns: None where the steps do not settle.
    """
    D = np.empty_like(right)
    places = (address(X), len(right), address(right), address(D))
    return D if library.solve_lyapunov(samples.place, period, near, *places) else None


@dataclass(frozen=True, eq=False)
class ComparedSeries:
    """A series of X against its equation: its residual F = X' + A' X + X A - X S X + Q, rounding included, and C = Q + X S X.

    share: the least r with -r C <= F <= r C, infinite where C or X is not positive; reach: the largest (R^-1 B' X B R^-1)_ii X_jj; product,
    gain, residual, size: the largest entries of |R^-1 B'| |X|, R^-1 (B' X + N'), F and X; sizes (n (n + 1) / 2): of F's entries.
    """

    share: float
    reach: float
    product: float
    gain: float
    residual: float
    size: float
    sizes: Array


def compare_with_equation(
    library: ctypes.CDLL, samples: RiccatiSamples, period: float, series: Array, every: int, unit: float
) -> ComparedSeries:
    """Compare a series with the equation half-way between every so many nodes; of the gain SEEN times are looked at.

    Parameters: unit: rounding of a sum relative to the sum of its sizes.
    """
    found = np.zeros(5 + series.shape[1])
    given = (samples.place, 2 * every, period, len(series) // 2, address(series), unit, SEEN, *samples.ports)
    share = library.compare_with_equation(*given, address(found))
    reach, product, gain, residual, size = found[:5].tolist()
    return ComparedSeries(share, reach, product, gain, residual, size, found[5:])


def reach_inputs(library: ctypes.CDLL, samples: RiccatiSamples, X: Array) -> float:
    """Return the largest (R^-1 B' X B R^-1)_ii X_jj at every second sample; X (N / 8, n (n + 1) / 2, 4)."""
    found = np.zeros(3)
    library.bound_gain(samples.place, 0, 2, 1, *samples.ports, address(X), address(found))
    return float(found[0])
