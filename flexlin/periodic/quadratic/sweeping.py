"""The stabilising solution of a smooth problem without fast modes: swept backwards over the period, which Newton's method closes."""

import ctypes
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_basis, fourier_nodes
from flexlin.periodic.quadratic.backward import Samples, find_sweeps, sweep_back
from flexlin.periodic.quadratic.linear_quadratic import LinearQuadratic, assemble_hamiltonian
from flexlin.periodic.quadratic.resolution import last_harmonic
from flexlin.periodic.quadratic.running_cost import judge_by_cost
from flexlin.periodic.quadratic.scattering import transpose
from flexlin.periodic.quadratic.solution import RiccatiSolution

COUNTS = ((256, 1e-9), (384, 1e-11), (512, 1e-13), (768, 1e-13), (1536, 1e-13))
"""Nodes of a period, and the least tol for which they were seen to serve."""
ORDER, REACH = 10, 0.085
"""Of Adams' method, and the largest product of a step and the Hamiltonian's spectral radius at which it is stable."""
COARSE_ORDER, COARSE_REACH, COARSER = 8, 0.13, 2
"""A first solution is swept with this order on every second node, where that is stable."""
WAVES = 8
"""Nodes for each wave of the coefficients, at least."""
MOST_STATES = 24
SWEEPS, FIRST, LAST = 12, 1e-7, 2e-3
"""The most sweeps, and the changes of X(T) by Newton's method after which coarse ones end, relative to X, and fine ones, to tol X."""
LEAST = 2e-13
"""Relative change of X(T) that is asked for at the least."""
TRIES = 2
PERIODS, CLOSED = 40, 1e-4
"""Doublings of the period within which a loop must forget, and what is left of it then."""
FLOOR = 2e-16
"""Harmonics of X below this part of its size are rounding."""
SQUARINGS, LOOKS = 6, 4
"""Squarings of the Hamiltonian by which its eigenvalues are measured, and times at which that is done."""


def solve_by_sweeps(problem: LinearQuadratic, period: float, tol: float) -> RiccatiSolution | None:
    """Solve where the Hamiltonian's eigenvalues are not fast, with a bound below tol on the error; None where this is no way.

    Assumes smooth coefficients.
    """
    library, waves = find_sweeps(), last_harmonic(problem, tol)
    if library is None or not waves * WAVES <= COUNTS[-1][0]:
        return None
    X: FourierSeries | None = None
    rate, tries = 0.0, 0
    for count, least in COUNTS:
        if count < WAVES * waves or REACH * count < rate * period or (tol < least and count < COUNTS[-1][0]):
            continue
        if tries == TRIES:
            break
        coefficients = problem.reduced(fourier_nodes(count, period))
        if coefficients[0].shape[1] > MOST_STATES:
            break
        rate = rate or find_rate(assemble_hamiltonian(*(one[:: count // LOOKS] for one in coefficients)))
        if REACH * count < rate * period:
            continue
        tries += 1
        samples = Samples.of(coefficients)
        with np.errstate(all="ignore"):
            X = sweep_until_closed(library, samples, period, X, rate, tol)
            found = None if X is None else judge_by_cost(problem, library, samples, X, rate)
        if found is not None and found.error <= tol:
            return found
    return None


def find_rate(H: Array) -> float:
    """Return about the largest spectral radius of matrices (N, m, m): |H^(2^k)|^(1 / 2^k)."""
    rate = 1.0
    for k in range(SQUARINGS):
        size = float(np.abs(H).max()) or 1.0
        rate *= size ** (0.5**k)
        H = H / size
        H = H @ H
    return float(rate * np.linalg.norm(H, axis=(1, 2)).max() ** (0.5**SQUARINGS))


def sweep_until_closed(
    library: ctypes.CDLL, samples: Samples, period: float, start: FourierSeries | None, rate: float, tol: float
) -> FourierSeries | None:
    """Return X by its values at every second node, rows filled up with zeros; from X = 0, the cost of a finite horizon, or from `start`.

    A sweep maps X(T) to X(0); with Phi its loop's transition matrix over the period, Newton's method for X(0) = X(T) adds

        E = Phi' E Phi + X(0) - X(T)

    Source: Hewer, IEEE Trans. Automat. Control 16 (1971) 382.
    """
    levels = [(samples, ORDER, max(LAST * tol, LEAST))]
    if start is None and rate * period <= COARSE_REACH / COARSER * samples.count:
        levels.insert(0, (samples.every(COARSER), COARSE_ORDER, FIRST))
    X = np.zeros((ORDER, *samples.shape[1:])) if start is None else start(fourier_nodes(samples.count, period)[:ORDER])
    for level, order, near in levels:
        closed = close_by_newton(library, level, period / level.count, order, near, X[:order])
        if closed is None:
            return None
        if level is not samples:
            X = np.tensordot(first_nodes(level.count, samples.count), closed, 1)
    return truncate(closed[::2], period)


def close_by_newton(
    library: ctypes.CDLL, samples: Samples, step: float, order: int, near: float, X: Array
) -> Array | None:
    """Sweep from X (p, n, w) at the first nodes until Newton's method changes X(T) by less than `near`: X at the nodes, (N, n, w).

    A loop that does not forget is swept on: the cost of a longer horizon has a better one.
    """
    n = samples.shape[1]
    for _ in range(SWEEPS):
        swept, end, Phi = sweep_back(library, samples, step, order, X)
        if not np.isfinite(end).all():
            return None
        E = close_period((end - X[0])[:, :n], Phi[0, :, :n])
        swept[0] = end
        if E is not None and np.abs(E).max() <= near * np.abs(swept).max():
            return swept
        X = swept[:order].copy()
        if E is not None:
            first = Phi[:, :, :n]
            X[:, :, :n] += transpose(first) @ E @ first
    return None


def close_period(gap: Array, Phi: Array) -> Array | None:
    """Solve E = Phi' E Phi + gap by doubling, about as well as Phi is known; None where the loop does not forget.

    Source: Smith, SIAM J. Appl. Math. 16 (1968) 198.
    """
    E, power = gap, Phi
    for _ in range(PERIODS):
        more = power.T @ E @ power
        E = E + more
        size, last = float(np.abs(E).max()), float(np.abs(more).max())
        if last <= CLOSED * size:
            return np.asarray(E)
        if not np.isfinite(size):
            break
        power = power @ power
    return None


@lru_cache(maxsize=8)
def first_nodes(coarse: int, fine: int) -> Array:
    """Return the matrix that takes values at N equally spaced times to those of their interpolant at the first of M times, (ORDER, N)."""
    harmonics = (coarse - 1) // 2
    values = fourier_basis(np.arange(coarse) / coarse, harmonics)
    values[:, 1:] *= 2
    return fourier_basis(np.arange(ORDER) / fine, harmonics) @ values.T / coarse


def truncate(values: Array, period: float) -> FourierSeries:
    """Return the Fourier series of values (N, n, w) without the last harmonics, which are rounding."""
    spectrum = np.fft.rfft(values, axis=0)
    size = np.abs(spectrum).max(axis=(1, 2))
    keep = int(np.count_nonzero(np.sqrt((size[::-1] ** 2).cumsum())[::-1] > FLOOR * size.max()))
    parts = spectrum[: min(max(keep, 1), (len(values) + 1) // 2)] / len(values)
    return FourierSeries(np.concatenate([parts[:1].real, 2 * parts[1:].real, -2 * parts[1:].imag]), period)
