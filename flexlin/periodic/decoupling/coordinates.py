"""Periodic coordinates that take the coupling out of modes whose shapes hardly change, by rounds of Fourier series."""

import ctypes
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import pointer
from flexlin.periodic.decoupling.library import find_library
from flexlin.periodic.decoupling.mean_modes import MeanModes
from flexlin.periodic.decoupling.waves import KEPT, circle_derivative, harmonics, interleaved, multiplier, shifted

NEAR = 0.2
"""A harmonic whose frequency comes closer to the gap of two eigenvalues than this part of it stays: it would not shrink."""
ENOUGH, SHRINK = 0.02, 0.8
"""Rounds end when the coupling's effect is this part of what is allowed, or shrinks by less than this factor."""
MAX_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class Coordinates:
    """w = P(t) z at nodes k T / N: P, P', P^-1 and the generator P^-1 (A P - P'), each (N, n, n), complex; the rounds that were made."""

    P: Array
    slope: Array
    inverse: Array
    generator: Array
    rounds: int


def find_coordinates(own: Array, modes: MeanModes, period: float, allowed: Array) -> Coordinates:
    """Make w' = own(t) w block diagonal up to couplings whose effect is small beside `allowed`.

    Each round takes P := P (1 + S), own := (1 + S)^-1 (own (1 + S) - S') with the Fourier coefficients

        S_ij,k = R_ij,k / (i k w - (b_i - b_j)),   R the coupling between groups, b the means of the diagonal,

    where the divisor is large enough. What is left is smaller by how much the diagonal varies beside the gap. By compiled code where
    there is a compiler; by NumPy otherwise, with the same numbers up to rounding.

    Parameters: own (N, n, n): generator in the modes of the mean; every other node builds P, the others check; allowed (n,) in 1/s.
    Source: averaging to high order: Sanders, Verhulst, Murdock, Averaging Methods in Nonlinear Dynamical Systems (2007), ch. 3.
    """
    library = find_library()
    return (
        iterate(own, modes, period, allowed)
        if library is None
        else iterate_compiled(library, own, modes, period, allowed)
    )


def iterate(own: Array, modes: MeanModes, period: float, allowed: Array) -> Coordinates:
    """The rounds by NumPy."""
    B, w, n = own[::2], 2 * np.pi / period, own.shape[-1]
    frequency = w * harmonics(len(B))[:, None, None]
    P = np.broadcast_to(np.eye(n, dtype=complex), B.shape)
    best, least, made = P, np.inf, 0
    while True:
        S, slope, worst = step_once(B, modes.outside, frequency, allowed)
        if not worst < SHRINK * least:
            made -= 1
            break
        best, least = P, worst
        if worst < ENOUGH or made == MAX_ROUNDS:
            break
        step = np.eye(n) + S
        P, B, made = P @ step, np.linalg.solve(step, B @ step - slope), made + 1
    P = interleaved(best, shifted(best, 0.5))
    slope = interleaved(circle_derivative(best, period), circle_derivative(best, period, 0.5))
    inverse = np.linalg.inv(P)
    inverse += inverse @ (np.eye(n) - P @ inverse)
    return Coordinates(P, slope, inverse, inverse @ (own @ P - slope), made)


def step_once(B: Array, outside: Array, frequency: Array, allowed: Array) -> tuple[Array, Array, float]:
    """S and S' at the nodes, and the largest effect of the coupling on a mode against what is allowed."""
    count = len(B)
    b = np.einsum("tii->i", B) / count
    gap = b[:, None] - b
    divisor = 1j * frequency - gap
    kept = outside & (np.abs(divisor) > NEAR * np.abs(gap)) & (np.abs(harmonics(count)) <= KEPT * count)[:, None, None]
    spectrum = np.fft.fft(B, axis=0)
    left = (np.abs(spectrum / count) ** 2 * (outside & ~kept)).sum(axis=0)
    spectrum = np.where(kept, spectrum / np.where(kept, divisor, 1), 0)
    S, slope = np.fft.ifft(spectrum, axis=0), np.fft.ifft(1j * frequency * spectrum, axis=0)
    size = np.abs(S).max(axis=0)
    effect = np.abs(gap) * size * size.T + (left * left.T) ** 0.25
    return S, slope, float((effect / allowed[:, None]).max())


@lru_cache(maxsize=4)
def tabulate_waves(count: int) -> tuple[int, int, Array, Array, Array]:
    """What the compiled rounds read for N nodes: the highest harmonic, eights of cosines and sines, and the matrices.

    Returns: most, width; forth (N, 8 width): cosines and sines at each node, padded; back (most + 1, 2, N): the same by harmonic;
    between (3, N, N): to values half-way between the nodes, to slopes at the nodes and between them, for the period 1, transposed.
    """
    most = int(KEPT * count)
    width = -(-(most + 1) // 4)
    angle = 2 * np.pi / count * (np.outer(np.arange(count), np.arange(4 * width)) % count)
    forth = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    back = np.stack([np.cos(angle), np.sin(angle)], axis=0).transpose(2, 0, 1)[: most + 1]
    between = np.array([multiplier(count, 0.5, *kind).T for kind in ((0, 0.5), (1, 0.0), (1, 0.5))], order="C")
    return most, width, np.ascontiguousarray(forth), np.ascontiguousarray(back), between


def iterate_compiled(library: ctypes.CDLL, own: Array, modes: MeanModes, period: float, allowed: Array) -> Coordinates:
    """The rounds by compiled code. Raises: MemoryError."""
    count, n = len(own) // 2, own.shape[-1]
    most, width, forth, back, between = tabulate_waves(count)
    between = between * np.array([1.0, 2 * np.pi / period, 2 * np.pi / period])[:, None, None]
    given = [np.ascontiguousarray(array) for array in (modes.mate.astype(np.intc), modes.outside, own, allowed)]
    made = np.empty((4, *own.shape), dtype=complex)
    at_mate, at_outside, at_own, at_allowed = map(pointer, given)
    rounds = library.find_coordinates(
        ctypes.c_int(n), ctypes.c_int(count // 8), at_mate, at_outside, at_own, ctypes.c_double(2 * np.pi / period), at_allowed,
        ctypes.c_int(MAX_ROUNDS), ctypes.c_double(NEAR), ctypes.c_double(ENOUGH), ctypes.c_double(SHRINK),
        ctypes.c_int(most), ctypes.c_int(width), *map(pointer, (forth, back, between, *made)),
    )  # fmt: skip
    if rounds == -2:
        raise MemoryError("the coordinates of a period")
    P, slope, inverse, generator = made
    return Coordinates(P, slope, inverse, generator, rounds)
