"""Decoupling from the modes of the mean by compiled code: what `decouple_on_nodes` in steady.py does, in one call."""

import ctypes
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.periodic.companion import build_companion
from flexlin.periodic.decoupling.coordinates import BEYOND, ENOUGH, EVEN, LEAST, MAX_ROUNDS, NEAR, SHRINK
from flexlin.periodic.decoupling.decouple import ROUGH, SPARSE
from flexlin.periodic.decoupling.decoupled import Decoupled, Diagonal
from flexlin.periodic.decoupling.mean_modes import MeanModes
from flexlin.periodic.decoupling.superadiabatic import SLOW_PART
from flexlin.periodic.decoupling.waves import KEPT, multiplier
from flexlin.periodic.fourier import FourierSeries, fourier_basis
from flexlin.periodic.product.perturbation import COHERENT
from flexlin.periodic.resolved.companion import ResolvedCompanion
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.uncertainty import EPS, ROUNDINGS

MOST_STATES = 128
"""States that the compiled code serves."""
UNSETTLED, NO_MEMORY = -3, -4
Coefficients = ResolvedMatrix | ResolvedCompanion


@dataclass(frozen=True, eq=False)
class SampledPeriod:
    """A (2 N, n, n) at N nodes and half-way between them; of a system of second order [M D K] there, and M^-1 at every SPARSE-th time."""

    A: Array
    blocks: Array | None = None
    inverse: Array | None = None
    whole: bool = False
    """Whether the compiled code has what it needs."""


@dataclass(frozen=True, eq=False)
class Tables:
    """Cosines and sines for N nodes, one after another, and how many harmonics and eights of them there are."""

    most: int
    width: int
    wide: int
    numbers: Array


@lru_cache(maxsize=4)
def tabulate_waves(count: int) -> Tables:
    """What the compiled rounds read for N nodes.

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
    return Tables(most, width, wide, np.concatenate([part.ravel() for part in (forth, back, between, every)]))


@lru_cache(maxsize=16)
def tabulate_basis(count: int, harmonics: int) -> Array:
    """The waves of a Fourier series at `count` equidistant times (count, 2 H + 1)."""
    return fourier_basis(np.arange(count) / count, harmonics)


def sample_series(library: ctypes.CDLL, coefficients: Coefficients, count: int) -> SampledPeriod:
    """Sample a system's Fourier series at N nodes and half-way between them. Raises: SingularMassMatrix."""
    series = coefficients.series
    assert isinstance(series, FourierSeries)
    flat = series.coefficients.reshape(len(series.coefficients), -1)
    values = tabulate_basis(2 * count, series.harmonics)[:, 1:] @ flat[1:]
    values += flat[0]
    if isinstance(coefficients, ResolvedMatrix):
        return SampledPeriod(values.reshape(2 * count, *coefficients.shape), whole=coefficients.shape[0] <= MOST_STATES)
    n = coefficients.blocks.shape[0]
    A, inverse = np.empty((2 * count, 2 * n, 2 * n)), np.empty((2 * count // SPARSE, n, n))
    if not library.sample_companion(n, 2 * count, SPARSE, *map(address, (values, A, inverse))):
        t = coefficients.period / (2 * count) * np.arange(2 * count)
        return SampledPeriod(build_companion(*coefficients.split(values.reshape(2 * count, n, 3 * n)), t))
    return SampledPeriod(A, values, inverse, 2 * n <= MOST_STATES)


def decouple_compiled(
    library: ctypes.CDLL, samples: SampledPeriod, coefficients: Coefficients, modes: MeanModes, tol: float
) -> Decoupled | Array | None:
    """As `decouple_on_nodes`, with `couple_uncertainty` for the coefficients. Raises: MemoryError."""
    A, period = samples.A, coefficients.period
    nodes, n = len(A), A.shape[-1]
    blocks = coefficients.blocks if isinstance(coefficients, ResolvedCompanion) else coefficients
    tables = tabulate_waves(nodes // 2)
    out, partner = np.empty(3 * 2 * A.size + 2 * n * n + 3 * n), np.empty(n, np.intc)
    limits = np.array(
        [ENOUGH, SHRINK, SLOW_PART, ROUGH, tol, EPS, ROUNDINGS * EPS, COHERENT / 3, NEAR, BEYOND, LEAST, EVEN]
    )
    second = (
        (0, 0)
        if samples.blocks is None or samples.inverse is None
        else tuple(map(address, (samples.blocks, samples.inverse)))
    )
    given = [modes.mate, modes.label, modes.values, modes.right, modes.left, tables.numbers, out, partner]
    rounds = library.decouple_on_nodes(
        n, nodes // 16, n // 2 if samples.blocks is not None else 0, MAX_ROUNDS, tables.most, tables.width, tables.wide, 2 * np.pi / period,
        address(limits), address(A), second[0], address(blocks.error), second[1], *map(address, given),
    )  # fmt: skip
    if rounds == NO_MEMORY:
        raise MemoryError("the coordinates of a period")
    if rounds < 0:
        return partner if rounds == UNSETTLED else None
    frame, inverse, generator = out[: 6 * A.size].view(complex).reshape(3, *A.shape)
    rest = out[6 * A.size :]
    residual, rounding = rest[: 2 * n * n].reshape(2, n, n)
    diagonal = Diagonal(rest[2 * n * n : -n].view(complex), rest[-n:])
    times, turning = period / nodes * np.arange(nodes), np.zeros(len(modes.groups), bool)
    return Decoupled(
        period, times, frame, inverse, generator, modes.groups, turning, residual, rounding, rounds, diagonal
    )
