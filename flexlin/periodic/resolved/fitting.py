"""A smooth function by its Fourier series, judged to repeat with its period, in one call of compiled code."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from flexlin._core import declare
from flexlin.checks import Array
from flexlin.periodic.fourier import FourierSeries, fourier_basis
from flexlin.periodic.resolved.comparing import find_deviation
from flexlin.periodic.resolved.foresight import Foreseen
from flexlin.periodic.resolved.harmonics import EPS, FACTOR, FEW_FACTOR, FIRST, TINY, few_phases, first_times
from flexlin.periodic.resolved.matrix import ResolvedMatrix
from flexlin.periodic.resolved.repetition import REPEAT
from flexlin.periodic.resolved.sampling import REPEATS, CheckPoints, Sampler, stratified, usual_phases
from flexlin.periodic.resolved.weights import HIDDEN


def size_arguments(sizes: Array, *_: Array) -> tuple[int, ...]:
    """How many numbers the arrays of `fit_series` hold."""
    nodes, checks, repeats, probes, entries, _ = sizes.tolist()
    waves = (nodes - 1) // 2 * 2
    return (
        6,
        (nodes + checks + repeats + probes) * entries,
        *(waves * k for k in (nodes, checks, repeats)),
        6,
        (waves + 1) * entries,
        3 * entries,
    )


FIT = declare(
    "int fit_series(const int *sizes, const double *values, const double *waves, const double *between, const double *later, "
    "const double *numbers, double *coefficients, double *bounds)",
    size_arguments,
)


def fit_at_once(
    source: Callable[[Array], Array], period: float, tol: float = 1e-13, weighed: bool = False, complete: bool = True
) -> ResolvedMatrix | None:
    """What `resolve` finds of a function that its first nodes follow; None where it is to be asked.

    Parameters: complete: whether its narrow features are named; without that it is looked at everywhere; source: known at `foresee_times`,
    and at others behind them; weighed: it is [M D K], and what is known behind them gives the sizes below which no entry counts, as
    `weigh_entries`. Raises: MemoryError, and what `Sampler` raises.
    """
    if not isinstance(source, Foreseen) or source.values.dtype != float:
        return None
    values, H = np.ascontiguousarray(source.values), (FIRST - 1) // 2
    samples, rows, columns = values.shape
    entries, (waves, between, later) = rows * columns, tabulate_first()
    probes = samples - FIRST - len(between) - len(later)
    sizes = np.array([FIRST, len(between), len(later), probes, entries, rows if weighed else 0], np.intc)
    numbers = np.array([tol, EPS, TINY, FEW_FACTOR if complete else 0.0, REPEAT, HIDDEN])
    coefficients, bounds = np.empty((2 * H + 1, rows, columns)), np.empty((3, rows, columns))
    kept = FIT(sizes, values, waves, between, later, numbers, coefficients, bounds)
    if kept == -2:
        raise MemoryError("the series of a period")
    if kept < 0:
        return None
    series, asked = coefficients[: 2 * kept + 1], samples - probes
    if not complete:
        sample = Sampler(source, period)
        sample(first_times(period))
        checks = CheckPoints(sample, period * usual_phases(), True)
        deviation = find_deviation(series.reshape(-1, entries), checks).reshape(rows, columns)
        if not (deviation <= 2 * bounds[0]).all():
            return None
        bounds[1] += FACTOR * deviation
        asked += sample.count - len(first_times(period))
    return ResolvedMatrix(FourierSeries(series, period), (), (), bounds[1], asked)


@lru_cache(maxsize=1)
def tabulate_first() -> tuple[Array, Array, Array]:
    """Cosines and sines of all harmonics at the first nodes, at the times between them, and at those that are asked a period later."""
    H = (FIRST - 1) // 2
    angle = 2 * np.pi / FIRST * (np.outer(np.arange(FIRST), np.arange(1, H + 1)) % FIRST)
    nodes = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    between, later = (
        np.ascontiguousarray(fourier_basis(phases, H)[:, 1:]) for phases in (few_phases(FIRST), stratified(REPEATS))
    )
    return nodes, between, later
