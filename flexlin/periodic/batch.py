"""Growth rates of many systems x' = A(t, p) x at once: a stability chart for anybody who has A.

`flexlin.periodic.batched` is the other batch: second-order systems, and all of their exponents.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, positive, real_array
from flexlin.errors import ArgumentError
from flexlin.periodic.collocation import accelerations, gauss, nodes, transitions
from flexlin.periodic.eigenvalues import EPS, NOISE, TINY, log_eigenvalues
from flexlin.periodic.floquet import floquet
from flexlin.periodic.grid import edges
from flexlin.periodic.product import balanced, paired
from flexlin.periodic.result import FloquetResult
from flexlin.periodic.setting import MAX_SEGMENTS
from flexlin.periodic.system import PeriodicSystem

BatchFunction = Callable[[Array, Array], Array | tuple[Array, Array, Array]]
STAGES, COARSE = 6, 5 / 8
"""Gauss stages of the batch, and the part of the segments that the second resolution has."""
SAFETY, TRUST = 6.0, 0.75
"""Factor on the estimated error, and the part of the method's order that it relies on."""
SEGMENTS = (8, 16, 32, 64)
"""The resolutions that are tried in turn; what is left then goes through `floquet` one by one."""
CHUNK_NODES = 3072
"""Coefficient samples in one call at the most, few enough for the processor's cache.

Memory stays below CHUNK_NODES * (3 + STAGES) * 8 n^2 bytes, however long the batch.
"""


@dataclass(frozen=True)
class BatchResult:
    """Floquet exponents (P, n) of P systems by falling real part, in 1/s, with the bounds `errors` (P, n) of their errors.

    growth (P,): real part of the leading exponent, and growth_error (P,) its error; verdict (P,): -1 stable, +1 unstable,
    0 undecided; one_by_one: how many values needed the careful route. Exponents far below the leading one that the resolution
    does not reach have large errors; that they are damped is certified by their sum alone (Liouville's identity).
    """

    exponents: Array
    errors: Array
    growth_error: Array
    one_by_one: int

    @property
    def growth(self) -> Array:
        return self.exponents[:, 0].real

    @property
    def verdict(self) -> Array:
        return np.where(np.abs(self.growth) > self.growth_error, np.sign(self.growth), 0).astype(int)


def floquet_batch(
    sample: BatchFunction,
    values: ArrayLike,
    period: float | ArrayLike,
    tol: float = 1e-8,
    *,
    breaks: Sequence[float] = (),
) -> BatchResult:
    """Compute the leading Floquet exponent of x' = A(t; value) x to `tol` for every value of a batch.

    Two resolutions of Gauss collocation for all values together; where they do not agree to tol, finer ones, and at last
    `floquet` itself.

    Assumes that A is smooth between the breaks (fractions of the period in [0, 1)).
    Parameters: sample: function (values (P, ...), t (P, N)) -> A (P, N, n, n), or the tuple M, D, K of second order;
    values (P, ...); period in s, one or (P,); tol in 1/s up to |lambda| = 1/s, relative beyond, for the leading exponent.
    Returns: BatchResult. Memory is bounded by chunks, see CHUNK_NODES.
    Raises: ArgumentError; TooManySegments from the careful route.
    """
    values = np.asarray(values)
    T = np.broadcast_to(real_array("period", period), len(values)).astype(float)
    if not len(values) or T.min() <= 0:
        raise ArgumentError("nothing to compute, or a period that is not positive", got=f"{len(values)} values")
    start = starting_level(sample, values, T, positive("tol", tol), breaks)
    chunk = max(1, CHUNK_NODES // (STAGES * SEGMENTS[start]))
    parts = [
        chunk_exponents(sample, values[i : i + chunk], T[i : i + chunk], tol, breaks, start)
        for i in range(0, len(values), chunk)
    ]
    exponents, errors, growth_error, careful = zip(*parts, strict=True)
    return BatchResult(np.concatenate(exponents), np.concatenate(errors), np.concatenate(growth_error), sum(careful))


def starting_level(sample: BatchFunction, values: Array, T: Array, tol: float, breaks: Sequence[float]) -> int:
    """The coarsest resolution that satisfies a few values spread over the batch."""
    probe = np.unique(np.linspace(0, len(values) - 1, 4).astype(int))
    for i, segments in enumerate(SEGMENTS):
        if attempt(sample, values[probe], T[probe], tol, breaks, segments)[3].mean() >= 0.5:
            return i
    return len(SEGMENTS) - 1


def chunk_exponents(
    sample: BatchFunction, values: Array, T: Array, tol: float, breaks: Sequence[float], start: int
) -> tuple[Array, Array, Array, int]:
    """Exponents, their errors and the growth's error of one chunk, and how many values went one by one."""
    exponents, errors, growth_error, done = attempt(sample, values, T, tol, breaks, SEGMENTS[start])
    for segments in SEGMENTS[start + 1 :]:
        left = np.flatnonzero(~done)
        if not len(left):
            break
        finer = attempt(sample, values[left], T[left], tol, breaks, segments)
        for array, part in zip((exponents, errors, growth_error, done), finer, strict=True):
            array[left] = part
    left = np.flatnonzero(~done)
    for i in left:
        result = one_by_one(sample, values[i : i + 1], float(T[i]), tol, breaks)
        exponents[i], errors[i] = result.exponents, result.errors
        upper, lower = (result.exponents.real + sign * result.errors for sign in (1, -1))
        growth = result.exponents[0].real
        growth_error[i] = max(float(upper.max()) - growth, growth - float(lower.max()))
    return exponents, errors, growth_error, len(left)


def one_by_one(sample: BatchFunction, value: Array, T: float, tol: float, breaks: Sequence[float]) -> FloquetResult:
    """The careful route for one value."""

    def at(t: Array) -> Array | tuple[Array, Array, Array]:
        return sample(value, t[None])

    corners = [T * b for b in breaks]
    probe = at(np.zeros(1))
    if isinstance(probe, tuple):
        M, D, K = (lambda t, i=i: at(t)[i][0] for i in range(3))
        system = PeriodicSystem.from_second_order(M, D, K, T, breaks=corners)
    else:
        system = PeriodicSystem(lambda t: np.asarray(at(t))[0], T, breaks=corners)
    return floquet(system, tol, max_segments=MAX_SEGMENTS)


def attempt(
    sample: BatchFunction, values: Array, T: Array, tol: float, breaks: Sequence[float], segments: int
) -> tuple[Array, Array, Array, Array]:
    """Exponents, errors, the growth's error and whether that meets tol, at one resolution and its check."""
    coarse = spectra(sample, values, T, breaks, round(COARSE * segments))[0]
    fine, rounding, trace = spectra(sample, values, T, breaks, segments, with_trace=True)
    apart = mutual_distances(fine, coarse)
    errors = (SAFETY * COARSE ** (TRUST * 2 * STAGES) * apart + rounding) / T[:, None]
    exponents = fine / T[:, None]
    resolved = errors <= tol * np.maximum(1, np.abs(exponents))
    growth = exponents[:, 0].real
    below = exponents.real < growth[:, None] - np.minimum(errors, 1.0)
    rest = trace / T - np.where(resolved, exponents.real, 0).sum(axis=1)
    damped = rest <= (~resolved).sum(axis=1) * growth + tol
    accepted = resolved[:, 0] & damped & (resolved | below).all(axis=1)
    return exponents, errors, errors[:, 0].copy(), accepted


def spectra(
    sample: BatchFunction, values: Array, T: Array, breaks: Sequence[float], segments: int, with_trace: bool = False
) -> tuple[Array, Array, Array]:
    """Logs of the multipliers (P, n), the rounding of each, and the integral of tr A over the period (P,) where asked."""
    rule = gauss(STAGES)
    grid = edges(1.0, breaks, segments)
    phase, weight = nodes(grid, rule.c), np.diff(grid)
    t = T[:, None] * phase.ravel()
    h = T[:, None] * weight
    got = sample(values, t)
    shape = (len(values), *phase.shape)
    if isinstance(got, tuple):
        M, D, K = (part.reshape(*shape, *part.shape[-2:]) for part in got)
        factors = accelerations(M, D, K, h, rule)
        drift = -np.linalg.solve(M, D) if with_trace else np.zeros_like(D)
    else:
        drift = got.reshape(*shape, *got.shape[-2:])
        factors = transitions(drift, h, rule)
    trace = np.einsum("pk,pksii,s->p", h, drift, rule.b)
    return *product_logs(factors), trace


def product_logs(factors: Array) -> tuple[Array, Array]:
    """Logs of the eigenvalues of each product of factors (P, K, n, n), by falling real part, and their rounding.

    The product is formed; its rounding is at most the largest partial product's, so an eigenvalue mu loses
    |largest| / |mu| roundings, and what loses all counts as unresolved.
    """
    count, segments, n = factors.shape[:3]
    factors = balanced(factors.reshape(-1, n, n))[0].reshape(factors.shape)
    steps = np.moveaxis(factors, 1, 0)
    largest = np.ones(count)
    while len(steps) > 1:
        steps = paired(steps)
        largest = np.maximum(largest, np.abs(steps).max(axis=(0, 2, 3)))
    logs = log_eigenvalues(steps[0])
    order = np.argsort(-logs.real, axis=1, kind="stable")
    logs = np.take_along_axis(logs, order, axis=1)
    size = np.maximum(np.exp(np.minimum(logs.real, 700.0)), TINY)
    return logs, np.minimum(NOISE * EPS * np.sqrt(segments) * largest[:, None] / size, 1e3)


def mutual_distances(fine: Array, coarse: Array) -> Array:
    """Distance (P, n) of each log to its partner; infinite where two logs are not each other's nearest."""
    apart = fine[:, :, None] - coarse[:, None, :]
    size = np.hypot(apart.real, np.remainder(apart.imag + np.pi, 2 * np.pi) - np.pi)
    partner, back = size.argmin(axis=2), size.argmin(axis=1)
    mutual = np.take_along_axis(back, partner, axis=1) == np.arange(fine.shape[1])
    return np.where(mutual, size.min(axis=2), np.inf)
