"""Exponents of smooth systems by one call of compiled code: what whole.py, or steady.py and exponents.py compute."""

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from math import log

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.lapack import find_routine
from flexlin.periodic.decoupling import coordinates, group_factors, mean_modes, steady, tame, whole
from flexlin.periodic.decoupling.decouple import ROUGH
from flexlin.periodic.decoupling.decoupled import Decoupled, Refusal
from flexlin.periodic.decoupling.group_factors import COARSE, FINE, FINER, METHOD
from flexlin.periodic.decoupling.grouping import Group
from flexlin.periodic.decoupling.several import SAFETY
from flexlin.periodic.decoupling.superadiabatic import SLOW_PART
from flexlin.periodic.decoupling.waves import KEPT, multiplier
from flexlin.periodic.fourier import fourier_basis
from flexlin.periodic.native.library import find_library
from flexlin.periodic.product.perturbation import CANCELLED, CLOSE, COHERENT, FACTOR_ROUNDING
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import IN_THE_MEAN, ResolvedMatrix
from flexlin.periodic.resolved.uncertainty import EPS, ROUNDINGS
from flexlin.periodic.transition.accelerations import tabulate_rule
from flexlin.periodic.transition.choice import MARGIN, WAVES, gauss_constant

MOST_STATES = 128
"""States that the compiled code serves."""
NO_MEMORY = 7
REASONS = {
    1: "no eigenvalues of the mean of A(t) stand apart, or they coincide, or its eigenvectors depend on each other",
    2: "A(t) mixes the modes of its mean",
    3: "modes of one group grow or decay by much against each other",
    4: "the coupling of the modes does not shrink enough",
    5: "the modes of a group grow or decay by much against each other",
    6: "M is singular",
}
"""Why the compiled code refuses."""
Coefficients = ResolvedMatrix | ResolvedCompanion
Found = tuple[Array, Array, float, Decoupled | int]
"""Exponents (n,) in 1/s, conjugates exactly, their errors (n,), the fastest rate in 1/s, and what was decoupled, or how many segments of
the whole were taken."""


def find_steady_solver(states: int) -> ctypes.CDLL | None:
    """The library whose `solve_at_once` serves so many states; none without a compiler, or where LAPACK cannot be called from C."""
    return find_library() if states <= MOST_STATES and find_routine("dgeev") else None


def solve_compiled(library: ctypes.CDLL, coefficients: Coefficients, tol: float, limit: int) -> Found | Refusal:
    """The exponents by falling real part, with what belongs to them, by few segments of the whole or by decoupling.

    They are those of `whole_exponents` with `limit` segments at most, or of `decouple_steady` and `decoupled_exponents` where all groups
    are tame. Raises: MemoryError.
    """
    blocks = coefficients.blocks if isinstance(coefficients, ResolvedCompanion) else coefficients
    rows, period = blocks.shape[0], coefficients.period
    n = 2 * rows if isinstance(coefficients, ResolvedCompanion) else rows
    series = np.ascontiguousarray(coefficients.series.coefficients)
    harmonics = len(series) // 2
    counts = [count for count in steady.COUNTS if harmonics < count]
    if not counts:
        return Refusal("A(t) has too many harmonics")
    sizes = count_sizes(n, rows if n > rows else 0, harmonics, len(counts))
    limits = np.array([*sizes, min(whole.FIRST, limit), min(whole.MOST, limit)], np.intc)
    numbers = tabulate_numbers().copy()
    numbers[TOL] = tol
    nodes, about, places = np.array([counts[0], counts[-1]], np.intc), np.empty(3), np.empty(3 * n, np.intc)
    out, exponents, errors = np.empty((12 * counts[-1] + 2) * n * n + 3 * n), np.empty(n, complex), np.empty(n)
    given: list[Array] = [numbers, series, np.ascontiguousarray(blocks.error)]
    made: list[Array] = [out, places, exponents, errors, about]
    answer = library.solve_at_once(
        address(limits),
        address(nodes),
        period,
        find_routine("dgeev"),
        *map(address, given),
        *tabulated(counts[0], counts[-1], harmonics).addresses,
        *map(address, made),
    )
    if answer == NO_MEMORY:
        raise MemoryError("the coordinates of a period")
    if answer:
        return Refusal(REASONS[answer])
    rounds, rate, growth = about.tolist()
    if rounds < 0:
        return exponents, errors, rate, -int(rounds)
    return exponents, errors, rate, divide_output(out, places, 2 * int(nodes[0]), period, int(rounds), growth)


def divide_output(out: Array, places: Array, times: int, period: float, rounds: int, growth: float) -> Decoupled:
    """What was decoupled, out of the numbers that the compiled code leaves."""
    n = len(places) // 3
    size = times * n * n
    frame, inverse, generator = out[: 6 * size].view(complex).reshape(3, times, n, n)
    rest = out[6 * size :]
    residual, rounding = rest[: 2 * n * n].reshape(2, n, n)
    labels, partner = places[n : 2 * n].tolist(), places[2 * n :].tolist()
    starts = [i for i in range(n) if i == 0 or labels[i] != labels[i - 1]]
    stops = [*starts[1:], n]
    groups = tuple(Group(a, b, k) for a, b, k in zip(starts, stops, partner, strict=False))
    at, turning = period / times * np.arange(times), np.zeros(len(groups), bool)
    return Decoupled(period, at, frame, inverse, generator, groups, turning, residual, rounding, rounds, growth)


TOL = 12
"""Where tol stands among the numbers."""


@lru_cache(maxsize=1)
def tabulate_numbers() -> Array:
    """The limits that the compiled code keeps to, in its order; those of decoupling begin with the ninth."""
    growth = log(tame.LARGEST_GROWTH)
    choice = [*steady.CLOSENESS, steady.PARTED, steady.MIXED, mean_modes.LARGEST, growth, SAFETY, group_factors.HIDDEN]
    made = [coordinates.ENOUGH, coordinates.SHRINK, SLOW_PART, ROUGH, 0.0, EPS, ROUNDINGS * EPS, COHERENT / 3]
    near = [coordinates.NEAR, coordinates.BEYOND, coordinates.LEAST]
    even = [coordinates.EVEN, coordinates.FAST, coordinates.OPEN]
    parts = [tame.GROWTH, tame.WAVES, tame.AIM, tame.LARGEST, tame.TRIES, FINE, COARSE, METHOD * FINER]
    followed = [tame.STEP, tame.FASTEST, *parts, CANCELLED, CLOSE, FACTOR_ROUNDING, EPS, tame.INDEPENDENT, growth]
    stages, constant = whole.STAGES, gauss_constant(whole.STAGES)
    segments = [IN_THE_MEAN, whole.SAFETY, MARGIN * constant, 2 * stages, WAVES / stages, whole.FINER]
    return np.array([*choice, *made, *near, *even, *followed, *segments])


@lru_cache(maxsize=16)
def count_sizes(n: int, coordinates_behind: int, harmonics: int, counts: int) -> tuple[int, ...]:
    """The whole numbers that the compiled code reads."""
    rounds, joins = coordinates.MAX_ROUNDS, steady.JOINS
    numbers = [n, coordinates_behind, harmonics, rounds, joins, counts, whole.LEAST, whole.STAGES, whole.MORE]
    return tuple(map(int, numbers))


@dataclass(frozen=True)
class Kept:
    """Arrays that are made once, and where they stand."""

    arrays: tuple[Array, ...]
    addresses: tuple[int, ...]


@lru_cache(maxsize=64)
def tabulated(first: int, second: int, harmonics: int) -> Kept:
    """Waves of the series at the times of both sets of nodes, those of the nodes, and the rules of Gauss for accelerations."""
    bases = [tabulate_basis(2 * count, harmonics) for count in (first, second)]
    arrays = (*bases, tabulate_waves(first), tabulate_waves(second), tabulate_tableaus())
    return Kept(arrays, tuple(address(one) for one in arrays))


@lru_cache(maxsize=4)
def tabulate_waves(count: int) -> Array:
    """What the compiled rounds read for N nodes, one after another.

    Eights of cosines and sines at each node (N, 8 width), padded; the same by harmonic (most + 1, 2, N); the matrices (3, N, N) to values
    half-way between the nodes, to slopes at the nodes and between them, for the period 2 pi, transposed; all harmonics to N at the nodes
    and between them (2 N, 8 wide).
    """
    most = int(KEPT * count)
    width, wide = -(-(most + 1) // 4), 2 * -(-(count + 1) // 8)
    angle = 2 * np.pi / count * (np.outer(np.arange(count), np.arange(4 * width)) % count)
    forth = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    back = np.stack([np.cos(angle), np.sin(angle)], axis=0).transpose(2, 0, 1)[: most + 1]
    between = np.array([multiplier(count, 0.5, *kind).T for kind in ((0, 0.5), (1, 0.0), (1, 0.5))])
    angle = np.pi / count * (np.outer(np.arange(2 * count), np.arange(4 * wide)) % (2 * count))
    every = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([part.ravel() for part in (forth, back, between, every)])


@lru_cache(maxsize=128)
def tabulate_basis(count: int, harmonics: int) -> Array:
    """The waves of a Fourier series at `count` equidistant times (count, 2 H + 1)."""
    return fourier_basis(np.arange(count) / count, harmonics)


@lru_cache(maxsize=1)
def tabulate_tableaus() -> Array:
    """Gauss' rules for accelerations one after another: c, a, a a, b of each."""
    return np.concatenate([tabulate_rule(whole.STAGES), tabulate_rule(whole.STAGES + whole.MORE)])
