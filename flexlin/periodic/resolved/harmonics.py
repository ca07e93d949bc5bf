"""A smooth periodic coefficient by its Fourier series: doubled until the last harmonics vanish, checked off the nodes."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from flexlin.checks import Array
from flexlin.periodic.fourier import fourier_basis, fourier_nodes, real_fourier_coefficients
from flexlin.periodic.resolved.comparing import find_deviation
from flexlin.periodic.resolved.noise import noise_level
from flexlin.periodic.resolved.sampling import CheckPoints, Sampler, stratified

FIRST, SURE, MOST = 64, 256, 2048
"""Nodes at the start; nodes up to which doubling goes on in any case; and at most."""
MEMORY = 2**25
"""Bytes that the samples may take."""
FALL = 30.0
"""Factor by which the last harmonics must fall on doubling, beyond SURE."""
SIGMAS = 6.0
"""Standard deviations of measured noise that count as agreement."""
FEW_CHECKS, FEW_FACTOR = 16, 6
"""Check points where narrow features are named, and the multiple of the largest deviation at them that is stated as error."""
FACTOR = 3
"""That multiple where a function is looked at everywhere."""
EPS, TINY = np.finfo(float).eps, 1e-290


@dataclass
class FourierFit:
    """Coefficients (2 H + 1, E), what may be left over and the bound on the error of each entry (E,)."""

    coefficients: Array
    allowed: Array
    error: Array


def fit_fourier(sample: Sampler, tol: float, checks: CheckPoints | None) -> FourierFit | None:
    """Resolve A by a Fourier series, or return None where panels serve better.

    Parameters: checks: None for the few that suffice when narrow features are named.
    """
    T, noise, worst = sample.period, None, np.inf
    values = sample(fourier_nodes(FIRST, T))
    count = FIRST
    while True:
        coefficients = real_fourier_coefficients(values)
        size = _amplitudes(coefficients)
        allowed = _allowed(sample.scale, size, tol, noise)
        excess = _excess(size, allowed)
        largest = float(excess.max())
        if noise is None and largest > 1 and _flat(size[:, excess > 1]):
            noise = _noise(sample)
            continue
        if largest <= 1:
            trimmed = _trimmed(coefficients, size, _floor(sample.scale, size, noise))
            deviation = _deviation(sample, trimmed, checks, count)
            agrees = bool((deviation <= 2 * allowed).all())
            if noise is None and not agrees:
                noise = _noise(sample)
                allowed = _allowed(sample.scale, size, tol, noise)
                agrees = bool((deviation <= 2 * allowed).all())
            if agrees:
                deviation *= FEW_FACTOR if checks is None else FACTOR
                return FourierFit(trimmed, allowed, _error(deviation, size, sample.scale))
        last, worst = worst, largest
        if count >= MOST or 2 * values.nbytes > MEMORY or (count >= SURE and (worst > last / FALL or worst <= 1)):
            return None
        between = sample(fourier_nodes(count, T) + T / (2 * count))
        values = np.stack([values, between], axis=1).reshape(2 * count, -1)
        count *= 2


@lru_cache(maxsize=4)
def first_times(period: float) -> Array:
    """The first nodes, and the few check points between them; kept, since they are asked for more than once."""
    times = np.concatenate([fourier_nodes(FIRST, period), period * few_phases(FIRST)])
    times.setflags(write=False)
    return times


def few_phases(count: int) -> Array:
    """Check points between N nodes: with the nodes, gaps stay below 1 / 100 of the period."""
    return stratified(FIRST if count == FIRST else FEW_CHECKS)


def _amplitudes(coefficients: Array) -> Array:
    H = len(coefficients) // 2
    return np.hypot(coefficients[1 : H + 1], coefficients[H + 1 :])


def _allowed(scale: Array, size: Array, tol: float, noise: Array | None) -> Array:
    """What may be left over (E,): tol of each entry's size, noise, and A' times the rounding of t."""
    allowed = np.maximum(tol * scale + TINY, np.minimum(_rounding(size), 1e-6 * scale))
    return allowed if noise is None else np.maximum(allowed, SIGMAS * noise)


def _floor(scale: Array, size: Array, noise: Array | None) -> Array:
    """The size of rounding and noise among the harmonics (E,)."""
    floor = np.maximum(2 * EPS * scale, _rounding(size) / 8)
    return floor if noise is None else np.maximum(floor, 1.5 * noise)


def _rounding(size: Array) -> Array:
    """The largest rate of A times the rounding of t = T."""
    return np.asarray(2 * np.pi * EPS * (np.arange(1, len(size) + 1.0) @ size))


def _excess(size: Array, allowed: Array) -> Array:
    """The largest of the last harmonics against a quarter of what may be left over (E,)."""
    return np.asarray(size[-max(4, len(size) // 4) :].max(axis=0) / (allowed / 4))


def _flat(size: Array) -> bool:
    """Whether some entry's last harmonics have stopped falling: noise, a narrow feature, or a place that is not smooth."""
    quarter = max(1, len(size) // 4)
    return bool(np.any(np.median(size[-quarter:], axis=0) >= 0.1 * np.median(size[-2 * quarter : -quarter], axis=0)))


def _noise(sample: Sampler) -> Array:
    half = sample.period * np.array([0.0, 0.5, 1.0])
    return noise_level(sample, half[:-1], half[1:]).max(axis=0)


def _trimmed(coefficients: Array, size: Array, floor: Array) -> Array:
    """Drop the last harmonics whose root of the sum of squares stays below `floor` (E,): rounding or noise in every entry."""
    left = ((size[::-1] / (floor + TINY)) ** 2).cumsum(axis=0)[::-1]
    H, keep = len(size), int(np.count_nonzero(np.any(left > 1, axis=1)))
    return np.concatenate([coefficients[: keep + 1], coefficients[H + 1 : H + 1 + keep]])


def _deviation(sample: Sampler, coefficients: Array, checks: CheckPoints | None, count: int) -> Array:
    """The largest deviation at check points (E,)."""
    if checks is not None:
        return find_deviation(coefficients, checks)
    t = sample.period * few_phases(count)
    fit = coefficients[0] + _few_waves(count, len(coefficients) // 2) @ coefficients[1:]
    return np.asarray(np.abs(fit - sample(t)).max(axis=0))


@lru_cache(maxsize=32)
def _few_waves(count: int, harmonics: int) -> Array:
    """Cosines and sines at the few check points, kept between calls: at most some 16 x 2048 numbers each."""
    return np.ascontiguousarray(fourier_basis(few_phases(count), harmonics)[:, 1:])


def _error(deviation: Array, size: Array, scale: Array) -> Array:
    """A multiple of the largest deviation seen, what the last harmonics would add, and the rounding of A and of one evaluation (E,)."""
    last = size[-max(4, len(size) // 4) :].sum(axis=0)
    return np.asarray(deviation + 2 * last + _rounding(size) + 4 * EPS * scale)
