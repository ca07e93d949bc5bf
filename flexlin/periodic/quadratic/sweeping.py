"""The stabilising solution of a smooth problem without fast modes: swept backwards over the period, which Newton's method closes."""

import ctypes
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_nodes
from flexlin.periodic.quadratic.backward import RiccatiSamples, close_by_newton, find_sweeps
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, assemble_hamiltonian
from flexlin.periodic.quadratic.resolution import last_harmonic
from flexlin.periodic.quadratic.running_cost import judge_by_cost
from flexlin.periodic.quadratic.solution import RiccatiSolution

COUNTS = (256, 384, 512, 768, 1024, 1536)
"""Nodes of a period that are tried."""
USUAL = 2.2
"""Nodes that a problem needs, as seen: this times the period, times the Hamiltonian's spectral radius, by tol^(1 / p) for order p."""
AIM = 0.3
"""Part of tol at which more nodes aim."""
LEVELS = ((4, 6, 0.15, 1e-3), (2, 8, 0.075, 1e-4), (1, 10, 0.085, 0.0))
"""Sweeps start on few nodes: every so many of them; the order of Adams' method; the largest product of a step and the Hamiltonian's
spectral radius at which it is stable; and the change of X(T), relative to X, after which more nodes are taken."""
WAVES = 8
"""Nodes for each wave of the coefficients, at least."""
MOST_STATES = 24
LAST, LEAST = 2e-4, 2e-13
"""The change of X(T) that ends the sweeps on all nodes, relative to tol X, and relative to X at the least."""
CLOSER, CLOSEST = 0.05, 5e-14
"""The factor on it for the next try, and what rounding leaves of it."""
TRIES = 2
FLOOR = 2e-16
"""Harmonics of X below this part of its size are rounding."""
SQUARINGS, LOOKS = 6, 4
"""Squarings of the Hamiltonian by which its eigenvalues are measured, and times at which that is done."""


def solve_by_sweeps(problem: LinearQuadratic, period: float, tol: float) -> RiccatiSolution | None:
    """Solve where the Hamiltonian's eigenvalues are not fast, with a bound below tol on the error; None where this is no way.

    Assumes smooth coefficients.
    """
    library, waves = find_sweeps(), last_harmonic(problem, tol)
    few = problem.reduced(period * np.arange(LOOKS) / LOOKS)
    if library is None or not waves * WAVES <= COUNTS[-1] or few[0].shape[1] > MOST_STATES:
        return None
    rate, (_, order, reach, _) = find_rate(assemble_hamiltonian(*few)), LEVELS[-1]
    least = max(WAVES * waves, rate * period / reach)
    needed, X = min(max(least, USUAL * rate * period * tol ** (-1 / order)), COUNTS[-2]), None
    near = max(LAST * tol, LEAST)
    for _ in range(TRIES):
        count = next((count for count in COUNTS if count >= max(needed, least)), None)
        if count is None:
            return None
        samples = RiccatiSamples.of(problem.reduced(fourier_nodes(count, period)))
        with np.errstate(all="ignore"):
            X = sweep_until_closed(library, samples, period, X, rate, near)
            found = None if X is None else judge_by_cost(problem, library, samples, X, rate)
        if found is None or found.error <= tol:
            return found
        needed, near = max(count + 1, count * (found.error / (AIM * tol)) ** (1 / order)), max(CLOSER * near, CLOSEST)
    return None


def find_rate(H: Array) -> float:
    """Return about the largest spectral radius of matrices (N, m, m): |trace H^k|^(1 / k) of two powers k, whatever the states' units."""
    logarithm, radius = 0.0, 0.0
    for k in range(1, SQUARINGS + 1):
        H = H @ H
        size = float(np.abs(H).max()) or 1.0
        H, logarithm = H / size, 2 * logarithm + np.log(size)
        if k > SQUARINGS - 2:
            trace = float(np.abs(np.trace(H, axis1=1, axis2=2)).max())
            radius = max(radius, trace ** (0.5**k) * float(np.exp(logarithm * 0.5**k)))
    return radius


def sweep_until_closed(
    library: ctypes.CDLL, samples: RiccatiSamples, period: float, start: FourierSeries | None, rate: float, near: float
) -> FourierSeries | None:
    """Return X by its values at every second node, rows filled up with zeros; from X = 0, the cost of a finite horizon, or from `start`."""
    last: tuple[int, int] | None = None
    begin = np.zeros((LEVELS[-1][1], *samples.shape[1:]))
    if start is not None:
        begin = start(fourier_nodes(samples.count, period)[: len(begin)])
    for step, order, reach, enough in LEVELS if start is None else LEVELS[-1:]:
        if rate * period * step > reach * samples.count:
            continue
        if last is not None:
            begin = np.tensordot(first_nodes(last[1], order, last[0] // step), begin[: last[1]], 1)
        X = close_by_newton(library, samples.every(step), period, order, enough or near, begin)
        if X is not None:
            begin, last = X, (step, order)
    return None if X is None else truncate(X[::2], period)


@lru_cache(maxsize=8)
def first_nodes(few: int, many: int, parts: int) -> Array:
    """Return the matrix that takes values at 0, 1, ... to those at 0, 1 / parts, ... of the polynomial through them, (many, few)."""
    at, nodes = np.arange(many) / parts, np.arange(few)
    factors = (at[:, None, None] - nodes) / np.where(np.eye(few), 1, nodes[:, None] - nodes)
    return np.asarray(np.where(np.eye(few), 1, factors).prod(axis=2))


def truncate(values: Array, period: float) -> FourierSeries:
    """Return the Fourier series of values (N, n, w): harmonics up to N / 3, whose residual shows at N times, and none that are rounding."""
    spectrum = np.fft.rfft(values, axis=0)
    size = np.abs(spectrum).max(axis=(1, 2))
    keep = int(np.count_nonzero(np.sqrt((size[::-1] ** 2).cumsum())[::-1] > FLOOR * size.max()))
    parts = spectrum[: min(max(keep, 1), len(values) // 3)] / len(values)
    return FourierSeries(np.concatenate([parts[:1].real, 2 * parts[1:].real, -2 * parts[1:].imag]), period)
