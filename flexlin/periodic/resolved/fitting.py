"""A Fourier series at the first attempt, in one call of compiled code."""

from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.compiler import address
from flexlin.periodic.fourier import fourier_basis
from flexlin.periodic.native.library import find_library
from flexlin.periodic.resolved.foresight import Foreseen
from flexlin.periodic.resolved.harmonics import EPS, FEW_FACTOR, FIRST, TINY, FourierFit, few_phases, first_times
from flexlin.periodic.resolved.sampling import Sampler


def fit_at_once(sample: Sampler, tol: float) -> FourierFit | None:
    """What `fit_fourier` finds on the first nodes, where few check points suffice and the samples are known; None where they do not agree.

    Raises: MemoryError.
    """
    library = find_library() if isinstance(sample.function, Foreseen) else None
    if library is None:
        return None
    count, values = sample.count, sample.unwrapped(first_times(sample.period))
    entries, scale = values.shape[1], sample.least_sizes()
    coefficients, bounds = np.empty((FIRST, entries)), np.empty((2, entries))
    waves, between = tabulate_first()
    numbers = np.array([tol, EPS, TINY])
    given = [np.ascontiguousarray(part) for part in (values[:FIRST], values[FIRST:])]
    kept = library.fit_series(
        FIRST,
        len(between),
        entries,
        FEW_FACTOR,
        *map(address, (*given, waves, between, numbers, scale, coefficients, bounds)),
    )
    if kept == -2:
        raise MemoryError("the series of a period")
    if kept < 0:
        sample.count = count
        return None
    np.maximum(sample.scale, scale, out=sample.scale)
    return FourierFit(coefficients[: 2 * kept + 1], bounds[0], bounds[1])


@lru_cache(maxsize=1)
def tabulate_first() -> tuple[Array, Array]:
    """Cosines and sines of all harmonics at the first nodes, and at the times between them."""
    H = (FIRST - 1) // 2
    angle = 2 * np.pi / FIRST * (np.outer(np.arange(FIRST), np.arange(1, H + 1)) % FIRST)
    nodes = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    return nodes, np.ascontiguousarray(fourier_basis(few_phases(FIRST), H)[:, 1:])
